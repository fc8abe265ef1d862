#include <gtest/gtest.h>

#include <numbers>

#include "core/odometry/features.hpp"
#include "tests/odometry/unlabelled_drive.hpp"

namespace stillmap::test {
namespace {

/// A lift of 2.2 m by 1.8 m with a handrail and someone's trolley.
BoxWorld lift() {
  BoxWorld world;
  world.noise_m = 0.015;
  for (const double side : {-1.0, 1.0}) {
    world.stand(1.6 * side, 0.0, {1.0, 3.0, 2.4}, SemanticClass::building);
    world.stand(0.0, 1.4 * side, {4.0, 1.0, 2.4}, SemanticClass::building);
  }
  world.boxes.push_back(
      {{0.0, 0.0, 2.9 - BoxWorld::lidar_height_m}, {4.0, 4.0, 1.0}, SemanticClass::building});
  world.boxes.push_back(
      {{1.05, 0.0, 0.9 - BoxWorld::lidar_height_m}, {0.06, 1.6, 0.1}, SemanticClass::building});
  world.stand(-0.85, -0.65, {0.4, 0.4, 1.0}, SemanticClass::building);
  return world;
}

SensorModel lidar_of_many_rings() {
  SensorModel sensor;
  sensor.name = "dome";
  sensor.rings = 64;
  sensor.columns = 256;
  sensor.fov_up = 50.0 * std::numbers::pi / 180.0;
  sensor.fov_down = -45.0 * std::numbers::pi / 180.0;
  sensor.min_range_m = 0.1;
  sensor.max_range_m = 50.0;
  return sensor;
}

TEST(CloseQuarters, KeepsEnoughPointsWhereAllIsNear) {
  const Scan scan = lift().scan(lidar_of_many_rings(), Eigen::Isometry3d::Identity(), 0.0).scan;
  const Features features = extract_surfaces(scan, FeatureConfig{});
  EXPECT_GT(features.surfaces.size(), 250U);
  EXPECT_GT(features.upright_points.size() + features.level_points.size(), 60U);
}

/// By a few dozen points a pose would wander by decimetres.
TEST(CloseQuarters, ALidarThatStandsInALiftStaysWhereItIs) {
  const auto T_world_lidar = [](int) { return Eigen::Isometry3d::Identity(); };
  follow_unlabelled(
      lift(), lidar_of_many_rings(), 30, T_world_lidar,
      [](const Eigen::Isometry3d& off) { EXPECT_LT(off.translation().norm(), 0.05); });
}

}  // namespace
}  // namespace stillmap::test
