#include "core/map/tile.hpp"

#include <gmock/gmock.h>

#include <cmath>
#include <limits>
#include <random>

#include "core/map/voxel_grid.hpp"
#include "tests/map/map_worlds.hpp"
#include "tests/numbers.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;

TEST(ClassEvidence, WithoutVotesIsUnlabeled) {
  const ClassEvidence evidence;
  EXPECT_EQ(evidence.winner(), unlabeled);
  EXPECT_EQ(evidence.share(), 0.0F);
}

TEST(ClassEvidence, WinnerHasMostWeightNotMostVotes) {
  ClassEvidence evidence;
  evidence.add(road, 0.3F);
  evidence.add(road, 0.3F);
  evidence.add(sidewalk, 0.9F);
  EXPECT_EQ(evidence.winner(), sidewalk);
  EXPECT_NEAR(evidence.share(), 0.9F / 1.5F,
              ClassEvidence::vote_steps * ClassEvidence::weight_step);
}

TEST(ClassEvidence, EqualWeightsGiveTheSameWinnerInEitherOrder) {
  ClassEvidence one;
  one.add(pole, 1.0F);
  one.add(trunk, 1.0F);
  ClassEvidence other;
  other.add(trunk, 1.0F);
  other.add(pole, 1.0F);
  EXPECT_EQ(one.winner(), other.winner());
}

TEST(ClassEvidence, UselessVotesChangeNothing) {
  ClassEvidence evidence;
  evidence.add(building, 0.5F);
  const ClassEvidence before = evidence;
  evidence.add(unlabeled, 1.0F);
  evidence.add(car, 0.0F);
  evidence.add(car, -3.0F);
  evidence.add(car, std::numeric_limits<float>::quiet_NaN());
  EXPECT_EQ(evidence, before);
}

TEST(ClassEvidence, InfiniteConfidenceCountsAsOne) {
  ClassEvidence evidence;
  evidence.add(car, std::numeric_limits<float>::infinity());
  EXPECT_EQ(evidence.votes()[0], (ClassEvidence::Vote{car, 1.0F}));
}

TEST(ClassEvidence, FrequentClassIsFoundAmongManyRareOnes) {
  ClassEvidence evidence;
  for (int i = 0; i < 300; ++i) {
    evidence.add(static_cast<SemanticClass>(9 + i % 8), 0.4F);
    evidence.add(traffic_sign, 0.6F);
  }
  EXPECT_EQ(evidence.winner(), traffic_sign);
}

TEST(ClassEvidence, VotesAtOnceCountAsOneAfterTheOther) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> confidence(-0.2F, 1.2F);
  ClassEvidence at_once, one_by_one;
  int refused = 0;
  for (int run = 0; run < 2000; ++run) {
    const auto label = static_cast<SemanticClass>(random() % 6);
    std::vector<float> votes(1 + random() % 5);
    std::uint32_t steps = 0;
    for (float& vote : votes) {
      vote = confidence(random);
      steps += ClassEvidence::steps_of_vote(vote);
      one_by_one.add(label, vote);
    }
    if (!at_once.add_at_once(label, steps)) {
      ++refused;
      for (const float vote : votes) at_once.add(label, vote);
    }
    ASSERT_EQ(at_once, one_by_one) << run;
  }
  EXPECT_GT(refused, 100);
}

TEST(ClassEvidence, LongStandingClassTurnsAfterSustainedContraryEvidence) {
  ClassEvidence evidence;
  for (int i = 0; i < 1'000'000; ++i) evidence.add(road, 1.0F);
  int votes = 0;
  for (; evidence.winner() == road && votes < 1000; ++votes) evidence.add(building, 1.0F);
  // The documented max_total * ln 2: neither at once nor never.
  EXPECT_NEAR(votes, ClassEvidence::max_total * std::log(2.0F), 2.0);
}

using Eigen::AlignedBox3d;
using Eigen::Vector3d;

using test::infinity;

TEST(TileLookup, AgreesWithBruteForceOnRandomBoxes) {
  const auto view = test::street_map(5, 200).view();
  std::mt19937 random(11);
  std::uniform_real_distribution<double> coordinate(-80.0, 80.0);
  for (int i = 0; i < 500; ++i) {
    AlignedBox3d box;
    for (int corner = 0; corner < 2; ++corner) {
      box.extend(Vector3d(coordinate(random), coordinate(random), coordinate(random)));
    }
    std::vector<std::shared_ptr<const Tile>> expected;
    for (const auto& tile : view->tiles) {
      if (box.intersects(tile->info.bounds_map.cast<double>())) expected.push_back(tile);
    }
    EXPECT_EQ(tiles_in_box(*view, box), expected);
  }
}

TEST(TileLookup, WholeWorldIsEveryTileAndNonsenseIsNone) {
  const auto view = test::street_map(1, 100).view();
  const AlignedBox3d everywhere(Vector3d::Constant(-infinity), Vector3d::Constant(infinity));
  EXPECT_EQ(tiles_in_box(*view, everywhere).size(), view->tiles.size());
  EXPECT_TRUE(tiles_in_box(*view, AlignedBox3d()).empty());
  AlignedBox3d no_number = everywhere;
  no_number.min().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(tiles_in_box(*view, no_number).empty());
  EXPECT_TRUE(tiles_in_box(MapSnapshot{}, everywhere).empty());
}

TEST(TileLookup, FindsTilesById) {
  const auto view = test::street_map(1, 100).view();
  for (const auto& tile : view->tiles) EXPECT_EQ(find_tile(*view, tile->info.id), tile);
  EXPECT_EQ(find_tile(*view, {1000, 1000}), nullptr);
  EXPECT_EQ(find_tile(*view, {-1000, 3}), nullptr);
  EXPECT_EQ(find_tile(MapSnapshot{}, {0, 0}), nullptr);
}

}  // namespace
}  // namespace stillmap
