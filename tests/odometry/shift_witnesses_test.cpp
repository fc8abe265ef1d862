#include "core/odometry/shift_witnesses.hpp"

#include <gtest/gtest.h>

#include <random>
#include <utility>

#include "core/odometry/odometry.hpp"
#include "core/odometry/scan_features.hpp"
#include "tests/odometry/box_sequence.hpp"
#include "tests/odometry/poses.hpp"
#include "tests/odometry/register_scan.hpp"

namespace stillmap {
namespace {

enum class Place { car_park, between_lorries, passage, meadow };

/// A thousand points round the lidar: of ground with cars on it or with lorries ahead and behind, of
/// a smooth passage, or anywhere in grass.
FeatureSets seen_in(Place place, unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(-1.0F, 1.0F);
  std::normal_distribution<float> noise(0.0F, 0.01F);
  FeatureSets sets;
  const auto add = [&](float x, float y, float z) {
    sets.surfaces.push_back(
        {.position_lidar = {x + noise(random), y + noise(random), z + noise(random)}});
  };
  for (int k = 0; k < 1000; ++k) {
    const float side = k % 2 == 0 ? 1.0F : -1.0F;
    if (place == Place::passage) {
      add(12.0F * unit(random), 3.0F * side, 1.5F * unit(random));
    } else if (place == Place::meadow) {
      add(10.0F * unit(random), 6.0F * unit(random), -1.0F + 0.3F * unit(random));
    } else if (k % 6 != 0) {
      add(12.0F * unit(random), 12.0F * unit(random), -1.7F);
    } else if (k % 12 == 0) {
      // Fronts and backs: of cars to both sides, or of the lorries ahead and behind alone.
      const bool is_car = place == Place::car_park;
      const float x = is_car && k % 48 >= 24 ? 10.0F : 6.0F;
      const float y = is_car ? (k % 96 < 48 ? 5.0F : -5.0F) : 0.0F;
      add(k % 24 == 0 ? x : -x, y + unit(random), -1.0F + 0.6F * unit(random));
    } else {
      add(5.0F + unit(random), k % 18 == 0 ? 7.0F : -7.0F, -1.0F + 0.6F * unit(random));
    }
  }
  return sets;
}

LocalMap map_of(Place place) {
  LocalMap map{LocalMapConfig{}};
  for (unsigned seed = 1; seed <= 10; ++seed) {
    FeatureSets sets;
    sets.planes = seen_in(place, seed).surfaces;
    extend_local_map(map, sets, Eigen::Isometry3d::Identity(), {});
  }
  return map;
}

bool tells_of_shift_along_x(Place place) {
  const LocalMap map = map_of(place);
  const FeatureSets features = seen_in(place, 77);
  const OdometryConfig config;
  OdometryResult found;
  PoseTangent shift = PoseTangent::Zero();
  shift.x() = 1.0;
  return witnesses_tell(shift, features, map, found, config);
}

TEST(ShiftWitnesses, CarsOnOpenGroundTellOfAShift) {
  EXPECT_TRUE(tells_of_shift_along_x(Place::car_park));
}

TEST(ShiftWitnesses, TheLorriesAheadAndBehindAloneDoNot) {
  EXPECT_FALSE(tells_of_shift_along_x(Place::between_lorries));
}

TEST(ShiftWitnesses, TheNoiseOfASmoothPassageDoesNot) {
  EXPECT_FALSE(tells_of_shift_along_x(Place::passage));
}

TEST(ShiftWitnesses, PlanesThroughGrassDoNot) {
  EXPECT_FALSE(tells_of_shift_along_x(Place::meadow));
}

TEST(ShiftWitnesses, AShiftTakesAlongTheTurnThatTheCovarianceTiesToIt) {
  OdometryResult found;
  found.covariance = Eigen::Matrix<double, 6, 6>::Identity();
  found.covariance(0, 5) = found.covariance(5, 0) = 0.1;
  found.covariance(0, 0) = 4.0;
  const PoseTangent shift = likely_shift(found, Eigen::Vector3d::UnitX());
  EXPECT_DOUBLE_EQ(shift.x(), 1.0);
  EXPECT_DOUBLE_EQ(shift[5], 0.025);
  EXPECT_DOUBLE_EQ(shift.segment<4>(1).norm(), 0.0);
}

/// A road of six lanes whose houses stand 30 m off the lidar, with masts and a few trees' trunks.
test::BoxWorld wide_road() {
  test::BoxWorld world;
  for (int k = -4; k <= 8; ++k) {
    const double x = 20.0 * k;
    if (k % 3 == 0) world.stand(x, 55.0 + k % 2, {14.0, 8.0, 8.0}, SemanticClass::building);
    world.stand(x + 4.0, 14.5, {0.3, 0.3, 9.0}, SemanticClass::pole);
    world.stand(x + 19.0, -14.5, {0.3, 0.3, 9.0}, SemanticClass::pole);
  }
  return world;
}

TEST(ShiftWitnesses, RightPosesOnAWideRoadAreGood) {
  const test::BoxSequence drive(wide_road(), 50);
  Odometry odometry(OdometryConfig{}, test::test_lidar());
  int good = 0;
  for (std::size_t k = 0; k < drive.scans.size(); ++k) {
    const OdometryResult result = test::register_scan(odometry, drive.scans[k].scan, {}).result;
    good += result.health == OdometryHealth::good ? 1 : 0;
    if (k > 10) {
      EXPECT_LT((result.T_map_lidar.translation() - drive.T_map_lidar[k].translation()).norm(), 0.2)
          << k;
    }
  }
  EXPECT_GE(good, 35);
}

}  // namespace
}  // namespace stillmap
