#include <gmock/gmock.h>

#include <cmath>
#include <limits>

#include "core/map/tile.hpp"

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
  EXPECT_NEAR(evidence.share(), 0.9F / 1.5F, 1e-6F);
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
  EXPECT_EQ(evidence.votes[0], (ClassEvidence::Vote{car, 1.0F}));
}

TEST(ClassEvidence, FrequentClassIsFoundAmongManyRareOnes) {
  ClassEvidence evidence;
  for (int i = 0; i < 300; ++i) {
    evidence.add(static_cast<SemanticClass>(9 + i % 8), 0.4F);
    evidence.add(traffic_sign, 0.6F);
  }
  EXPECT_EQ(evidence.winner(), traffic_sign);
}

TEST(ClassEvidence, LongStandingClassTurnsAfterSustainedContraryEvidence) {
  ClassEvidence evidence;
  for (int i = 0; i < 1'000'000; ++i) evidence.add(road, 1.0F);
  int votes = 0;
  for (; evidence.winner() == road && votes < 1000; ++votes) evidence.add(building, 1.0F);
  // The documented max_total * ln 2: neither at once nor never.
  EXPECT_NEAR(votes, ClassEvidence::max_total * std::log(2.0F), 2.0);
}

}  // namespace
}  // namespace stillmap
