#include <gtest/gtest.h>

#include <algorithm>
#include <numbers>

#include "core/odometry/odometry.hpp"
#include "tests/odometry/box_world.hpp"
#include "tests/odometry/register_scan.hpp"

namespace stillmap::test {
namespace {

/// Rows of parked cars across the way, of different sizes, and a lamp here and there.
BoxWorld car_park() {
  BoxWorld world;
  for (int row = -2; row <= 6; ++row)
    for (int bay = -14; bay <= 14; ++bay) {
      const double y = 2.7 * bay;
      if (std::abs(y) < 3.0 || (7 * row + 3 * bay) % 6 == 0) continue;
      const double longer_m = 0.1 * ((5 * row + bay) & 3);
      world.stand(11.0 * row + 0.2 * (bay & 1), y, {4.1 + longer_m, 1.8, 1.45 + longer_m},
                  SemanticClass::car);
    }
  for (const double x : {-15.0, 16.0, 48.0})
    world.stand(x, 4.0, {0.2, 0.2, 7.0}, SemanticClass::pole);
  return world;
}

/// The largest error of position of a lidar that sets off along x, by true labels [m]. It is taken
/// for `sensor`, and fires as often as `fires` does.
double worst_error_m(const BoxWorld& world, Weighting weighting, const SensorModel& sensor,
                     const SensorModel& fires) {
  OdometryConfig config;
  config.weighting = weighting;
  Odometry odometry(config, sensor);
  double worst_m = 0.0;
  double x = 0.0;
  for (int k = 0; k < 30; ++k) {
    const Eigen::Isometry3d T_map_lidar(Eigen::Translation3d(x, 0.0, 0.0));
    const BoxScan seen = world.scan(fires, T_map_lidar, 0.1 * k);
    const OdometryResult found = register_scan(odometry, seen.scan, seen.labels()).result;
    worst_m =
        std::max(worst_m, (found.T_map_lidar.translation() - T_map_lidar.translation()).norm());
    if (x > 2.0) {
      EXPECT_EQ(found.health, OdometryHealth::good) << "scan " << k;
    }
    x += std::min(0.6, 0.04 * k);
  }
  return worst_m;
}
double worst_error_m(const BoxWorld& world, Weighting weighting,
                     const SensorModel& sensor = test_lidar()) {
  return worst_error_m(world, weighting, sensor, sensor);
}

TEST(MovableWorld, ACarParkHoldsTheLidarThoughAllOfItCouldMove) {
  const double without_labels_m = worst_error_m(car_park(), Weighting::geometric);
  EXPECT_LT(without_labels_m, 0.05);
  EXPECT_LT(worst_error_m(car_park(), Weighting::semantic), without_labels_m + 0.02);
}

/// Of houses so far off that no two of its rings make a surface there.
TEST(MovableWorld, ACarParkHoldsSixteenRingsBeforeHousesFarOff) {
  SensorModel sensor = test_lidar();
  sensor.rings = 16;
  sensor.fov_up = 15.0 * std::numbers::pi / 180.0;
  sensor.fov_down = -sensor.fov_up;
  BoxWorld world = car_park();
  for (const double side : {-1.0, 1.0})
    for (int k = -2; k <= 4; ++k)
      world.stand(30.0 * k, side * 60.0, {22.0, 8.0, 14.0}, SemanticClass::building);
  const double without_labels_m = worst_error_m(world, Weighting::geometric, sensor);
  EXPECT_LT(without_labels_m, 0.1);
  EXPECT_LT(worst_error_m(world, Weighting::semantic, sensor), without_labels_m + 0.05);
}

/// A hall along the way, of which nothing tells how far the lidar has come, in sight of a lidar
/// that fires 400 times a turn.
TEST(MovableWorld, ACarParkHoldsTheLidarBeforeALongHall) {
  SensorModel fires_seldom = test_lidar();
  fires_seldom.columns = 400;
  BoxWorld world = car_park();
  world.stand(20.0, 62.0, {160.0, 10.0, 9.0}, SemanticClass::building);
  EXPECT_LT(worst_error_m(world, Weighting::semantic, test_lidar(), fires_seldom), 0.1);
}

/// Between rows of lorries that drive as the lidar does, and little else.
TEST(MovableWorld, WhatDrivesAlongWithTheLidarIsNotCalledGood) {
  const double speed_m_s = 6.0;
  BoxWorld world;
  for (int k = -3; k <= 3; ++k)
    for (const double side : {-3.5, 3.5})
      world.stand(13.0 * k + side, side, {11.0, 2.5, 3.8}, SemanticClass::truck,
                  {speed_m_s, 0.0, 0.0});
  for (const double x : {-14.0, 20.0})
    world.stand(x, 0.0, {9.0, 2.5, 3.8}, SemanticClass::truck, {speed_m_s, 0.0, 0.0});
  for (int k = -2; k <= 5; ++k) world.stand(19.0 * k, 8.0, {0.3, 0.3, 6.0}, SemanticClass::pole);
  Odometry odometry(OdometryConfig{}, test_lidar());
  for (int k = 0; k < 25; ++k) {
    const Eigen::Isometry3d T_map_lidar(Eigen::Translation3d(0.1 * speed_m_s * k, 0.0, 0.0));
    const BoxScan seen = world.scan(test_lidar(), T_map_lidar, 0.1 * k);
    const OdometryResult found = register_scan(odometry, seen.scan, seen.labels()).result;
    const double off_m = (found.T_map_lidar.translation() - T_map_lidar.translation()).norm();
    EXPECT_FALSE(found.health == OdometryHealth::good && off_m > 0.5) << k << ": " << off_m << " m";
  }
}

/// Way after a time of what sets off then [m].
double way_m(double since_s) {
  constexpr double acceleration_m_s2 = 1.5;
  constexpr double until_s = 4.0;
  const double speeding_s = std::clamp(since_s, 0.0, until_s);
  return acceleration_m_s2 *
         (0.5 * speeding_s * speeding_s + until_s * std::max(0.0, since_s - until_s));
}

/// Lorries beside, in front of and behind the lidar, and few poles.
BoxWorld jam(double lorries_are_at_m) {
  BoxWorld world;
  for (int k = -3; k <= 3; ++k)
    for (const double side : {-3.5, 3.5})
      world.stand(13.0 * k + side + lorries_are_at_m, side, {11.0, 2.5, 3.8}, SemanticClass::truck);
  for (const double x : {-14.0, 20.0})
    world.stand(x + lorries_are_at_m, 0.0, {9.0, 2.5, 3.8}, SemanticClass::truck);
  for (int k = -4; k <= 8; ++k) world.stand(19.0 * k, 8.0, {0.3, 0.3, 6.0}, SemanticClass::pole);
  return world;
}

/// At a light in open land, with some vehicles, of which one stays, and few poles.
BoxWorld at_a_light(double vehicles_are_at_m) {
  BoxWorld world;
  for (int k = -4; k <= 8; ++k) world.stand(25.0 * k, 8.0, {0.2, 0.2, 5.0}, SemanticClass::pole);
  world.stand(11.0 + vehicles_are_at_m, 0.0, {9.0, 2.5, 3.8}, SemanticClass::truck);
  world.stand(11.0 + vehicles_are_at_m, 3.5, {4.2, 1.8, 1.5}, SemanticClass::car);
  world.stand(1.0 + vehicles_are_at_m, 3.5, {5.2, 2.0, 2.0}, SemanticClass::truck);
  world.stand(-9.0, 0.0, {4.2, 1.8, 1.5}, SemanticClass::car);
  return world;
}

struct WrongPoses {
  int good = 0;
  int in_map = 0;
  double worst_m = 0.0;
};

/// Among vehicles that drive otherwise than the lidar, `world_at(t)` and `lidar_x_at(t)`.
template <class WorldAt, class LidarAt>
WrongPoses wrong_poses(WorldAt world_at, LidarAt lidar_x_at) {
  Odometry odometry(OdometryConfig{}, test_lidar());
  WrongPoses wrong;
  for (int k = 0; k < 50; ++k) {
    const double t = 0.1 * k;
    const Eigen::Isometry3d T_map_lidar(Eigen::Translation3d(lidar_x_at(t), 0.0, 0.0));
    const BoxScan seen = world_at(t).scan(test_lidar(), T_map_lidar, t);
    const OdometryResult found = register_scan(odometry, seen.scan, seen.labels()).result;
    const double off_m = (found.T_map_lidar.translation() - T_map_lidar.translation()).norm();
    wrong.worst_m = std::max(wrong.worst_m, off_m);
    if (off_m < 0.5) continue;
    wrong.good += found.health == OdometryHealth::good ? 1 : 0;
    wrong.in_map += found.is_confirmed() ? 1 : 0;
  }
  return wrong;
}

TEST(MovableWorld, WhatSetsOffBesideARestingLidarIsNotCalledGood) {
  const auto lorries = [](double t) { return jam(way_m(t - 2.0)); };
  const WrongPoses wrong = wrong_poses(lorries, [](double) { return 0.0; });
  EXPECT_EQ(wrong.good, 0);
  EXPECT_EQ(wrong.in_map, 0);
}

TEST(MovableWorld, WhatDrivesFasterThanTheLidarIsNotCalledGood) {
  const auto lorries = [](double t) { return jam(6.0 * t); };
  const WrongPoses wrong = wrong_poses(lorries, [](double t) { return 3.0 * t; });
  EXPECT_EQ(wrong.good, 0);
  // The first ones, of which nobody knows yet how well scans fit.
  EXPECT_LE(wrong.in_map, 9);
}

TEST(MovableWorld, FewPolesHoldTheLidarWhereTheVehiclesBesideItSetOff) {
  const auto vehicles = [](double t) { return at_a_light(way_m(t - 2.0)); };
  const auto lidar_x = [](double t) { return way_m(t - 2.5); };
  EXPECT_LT(wrong_poses(vehicles, lidar_x).worst_m, 3.5)
      << "along with those it would be 4.5 m off";
}

/// A network that takes houses for lorries, and one that takes the road for one.
TEST(MovableWorld, OneClassThatIsTakenForVehiclesDoesNotMatter) {
  for (const auto wrong : {SemanticClass::building, SemanticClass::road}) {
    OdometryConfig config;
    Odometry odometry(config, test_lidar());
    const BoxWorld world = street();
    double worst_m = 0.0;
    for (int k = 0; k < 25; ++k) {
      const Eigen::Isometry3d T_map_lidar(Eigen::Translation3d(0.7 * k, 0.0, 0.0));
      BoxScan seen = world.scan(test_lidar(), T_map_lidar, 0.1 * k);
      std::ranges::replace(seen.scan.labels, wrong, SemanticClass::truck);
      const auto found = register_scan(odometry, seen.scan, seen.labels()).result.T_map_lidar;
      worst_m = std::max(worst_m, (found.translation() - T_map_lidar.translation()).norm());
    }
    EXPECT_LT(worst_m, 0.1) << name(wrong);
  }
}

}  // namespace
}  // namespace stillmap::test
