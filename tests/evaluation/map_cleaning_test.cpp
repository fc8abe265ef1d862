#include "core/evaluation/map_cleaning.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

namespace stillmap::evaluation {
namespace {

using Points = std::vector<Eigen::Vector3f>;
using Ids = std::vector<std::uint16_t>;

constexpr std::uint16_t road_id = 40, car_id = 10, moving_car_id = 252;

Points random_points(std::size_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> coordinate(-3.0F, 3.0F);
  Points points(count);
  for (auto& p : points) p = {coordinate(random), coordinate(random), 0.2F * coordinate(random)};
  return points;
}

TEST(MapTruth, PutsPointsIntoVoxelsAndAveragesThem) {
  MapTruth truth(0.2);
  truth.add(Points{{0.05F, 0.1F, 0.1F}, {0.15F, 0.1F, 0.1F}, {-0.05F, 0.1F, 0.1F}},
            Ids{road_id, moving_car_id, road_id});
  const auto voxels = truth.voxels();
  ASSERT_EQ(voxels.size(), 2U);
  const auto& shared =
      voxels[0].fixed_points + voxels[0].moving_points == 2 ? voxels[0] : voxels[1];
  EXPECT_NEAR(shared.mean_map.x(), 0.1F, 1e-6F);
  EXPECT_EQ(shared.moving_points, 1U);
}

TEST(MapTruth, LeavesOutUnlabeledOutlierAndNonFinitePoints) {
  MapTruth truth;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  truth.add(Points{{1, 1, 1}, {2, 2, 2}, {nan, 0, 0}}, Ids{0, 1, road_id});
  EXPECT_TRUE(truth.voxels().empty());
}

TEST(MapTruth, RefusesDifferentLengthsAndAVoxelOfNoSize) {
  MapTruth truth;
  EXPECT_THROW(truth.add(Points{{0, 0, 0}}, Ids{}), std::invalid_argument);
  EXPECT_THROW(MapTruth(0.0), std::invalid_argument);
  EXPECT_THROW(MapTruth(std::numeric_limits<double>::quiet_NaN()), std::invalid_argument);
}

TEST(MapCleaningScore, RatesWhatIsKeptOfEachKind) {
  MapTruth truth;
  truth.add(
      Points{{0.1F, 0.1F, 0.1F}, {5.1F, 0.1F, 0.1F}, {10.1F, 0.1F, 0.1F}, {15.1F, 0.1F, 0.1F}},
      Ids{road_id, road_id, car_id, moving_car_id});
  const MapCleaningScore score =
      map_cleaning_score(truth, Points{{0.15F, 0.1F, 0.1F}, {15.1F, 0.15F, 0.1F}});
  EXPECT_DOUBLE_EQ(score.preservation_rate().value(), 0.5);
  EXPECT_DOUBLE_EQ(score.preservation_rate_with_parked().value(), 1.0 / 3.0);
  EXPECT_DOUBLE_EQ(score.rejection_rate().value(), 0.0);
  EXPECT_DOUBLE_EQ(score.f1().value(), 0.0);
  EXPECT_DOUBLE_EQ(score.parked_rejection_rate().value(), 1.0);
}

TEST(MapCleaningScore, TellsThinThingsApart) {
  constexpr std::uint16_t fence_id = 51, pole_id = 80;
  MapTruth truth;
  truth.add(Points{{0.1F, 0.1F, 0.1F},
                   {5.1F, 0.1F, 0.1F},
                   {10.1F, 0.1F, 0.1F},
                   {15.1F, 0.1F, 0.1F},
                   {15.1F, 0.1F, 0.1F}},
            Ids{fence_id, fence_id, pole_id, pole_id, road_id});
  const MapCleaningScore score = map_cleaning_score(truth, Points{{0.15F, 0.1F, 0.1F}});
  EXPECT_EQ(score.fixed_voxels, 4U);
  for (std::size_t i = 0; i < thin_classes.size(); ++i) {
    SCOPED_TRACE(name(thin_classes.at(i)));
    const bool is_fence = thin_classes.at(i) == SemanticClass::fence;
    const bool is_pole = thin_classes.at(i) == SemanticClass::pole;
    EXPECT_EQ(score.thin_voxels.at(i), is_fence ? 2U : is_pole ? 1U : 0U) << "half road is none";
    EXPECT_EQ(score.thin_kept.at(i), is_fence ? 1U : 0U);
    EXPECT_EQ(score.thin_preservation_rate(i).has_value(), is_fence || is_pole);
  }
}

TEST(MapCleaningScore, AnEmptyMapRejectsEverythingAndPreservesNothing) {
  MapTruth truth;
  truth.add(Points{{0, 0, 0}, {9, 9, 9}}, Ids{road_id, moving_car_id});
  const MapCleaningScore score = map_cleaning_score(truth, {});
  EXPECT_DOUBLE_EQ(score.preservation_rate().value(), 0.0);
  EXPECT_DOUBLE_EQ(score.rejection_rate().value(), 1.0);
}

TEST(MapCleaningScore, HasNoRatesWithoutTruth) {
  const MapCleaningScore score = map_cleaning_score(MapTruth{}, Points{{0, 0, 0}});
  EXPECT_FALSE(score.preservation_rate().has_value());
  EXPECT_FALSE(score.rejection_rate().has_value());
}

TEST(MapCleaningScore, AgreesWithASearchThroughAllPoints) {
  MapTruth truth;
  const Points true_points = random_points(800, 1);
  truth.add(true_points, Ids(true_points.size(), road_id));
  const Points map_points = random_points(500, 2);
  const float radius_m = std::sqrt(3.0F) / 2.0F * 0.2F;
  std::uint64_t kept = 0;
  for (const MapTruth::Voxel& voxel : truth.voxels()) {
    for (const Eigen::Vector3f& point : map_points) {
      if ((point - voxel.mean_map).norm() <= radius_m) {
        ++kept;
        break;
      }
    }
  }
  ASSERT_GT(kept, 0U);
  EXPECT_EQ(map_cleaning_score(truth, map_points).fixed_kept, kept);
}

}  // namespace
}  // namespace stillmap::evaluation
