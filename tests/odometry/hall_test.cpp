#include <gtest/gtest.h>

#include <array>
#include <numbers>
#include <string>

#include "tests/odometry/unlabelled_drive.hpp"

namespace stillmap::test {
namespace {

constexpr double degree = std::numbers::pi / 180.0;

/// A hall of 50 m x 28 m with eight columns round a circle that a robot drives.
struct Hall {
  std::string name;
  SensorModel sensor;
  /// The lidar looks down at the front by so much.
  double tilt_rad = 0.0;
  /// And is swayed by so much, as in a hand.
  double sway_rad = 0.0;
  double ceiling_m = 6.0;
};

BoxWorld world_of(const Hall& hall) {
  constexpr double wall_m = 1.0;
  BoxWorld world;
  world.noise_m = 0.02;
  for (const double side : {-1.0, 1.0}) {
    world.stand(side * 25.5, 0.0, {wall_m, 30.0, hall.ceiling_m}, SemanticClass::building);
    world.stand(0.0, side * 14.5, {52.0, wall_m, hall.ceiling_m}, SemanticClass::building);
  }
  world.boxes.push_back({{0.0, 0.0, hall.ceiling_m + 0.5 * wall_m - BoxWorld::lidar_height_m},
                         {52.0, 30.0, wall_m},
                         SemanticClass::building});
  constexpr std::array<std::array<double, 2>, 8> columns = {
      {{-18, 6}, {-11, -7}, {-4, 11}, {3, -3}, {12, 7}, {13, -9}, {19, 2}, {-21, -4}}};
  for (const auto& [x, y] : columns)
    world.stand(x, y, {0.6, 0.6, hall.ceiling_m}, SemanticClass::building);
  return world;
}

/// Round a circle of 8 m at 1.5 m/s.
Eigen::Isometry3d T_hall_lidar(const Hall& hall, double time_s) {
  constexpr double radius_m = 8.0;
  const double angle = 1.5 * time_s / radius_m;
  const auto about = [](double by_rad, const Eigen::Vector3d& axis) {
    return Eigen::AngleAxisd(by_rad, axis);
  };
  return Eigen::Translation3d(radius_m * std::cos(angle), radius_m * std::sin(angle), 0.0) *
         about(angle + 0.5 * std::numbers::pi, Eigen::Vector3d::UnitZ()) *
         about(hall.tilt_rad, Eigen::Vector3d::UnitY()) *
         about(hall.sway_rad * std::sin(5.0 * time_s), Eigen::Vector3d::UnitX()) *
         about(hall.sway_rad * std::sin(6.1 * time_s + 1.0), Eigen::Vector3d::UnitY());
}

SensorModel with_columns(SensorModel sensor) {
  sensor.columns = 900;
  return sensor;
}

class Halls : public testing::TestWithParam<Hall> {};

/// The rings of the first scans lie best on each other where the lidar has not tilted, which is
/// wrong of one that is held tilted, or sways.
TEST_P(Halls, ALidarIsFollowedFromItsFirstScanOnHoweverItIsHeld) {
  const Hall& hall = GetParam();
  const auto T_world_lidar = [&](int k) { return T_hall_lidar(hall, 0.1 * k); };
  follow_unlabelled(world_of(hall), hall.sensor, 40, T_world_lidar,
                    [](const Eigen::Isometry3d& off) {
                      EXPECT_LT(off.translation().norm(), 0.05);
                      EXPECT_LT(Eigen::AngleAxisd(off.linear()).angle(), 0.4 * degree);
                    });
}

INSTANTIATE_TEST_SUITE_P(
    Sparse, Halls,
    testing::Values(
        Hall{.name = "Upright", .sensor = with_columns(vlp_16())},
        Hall{.name = "Tilted", .sensor = with_columns(vlp_16()), .tilt_rad = 15.0 * degree},
        Hall{.name = "Swayed", .sensor = with_columns(vlp_16()), .sway_rad = 3.0 * degree},
        Hall{.name = "SwayedWith32Rings",
             .sensor = with_columns(hdl_32e()),
             .sway_rad = 4.0 * degree},
        Hall{.name = "UnderALowCeiling", .sensor = with_columns(vlp_16()), .ceiling_m = 3.0}),
    [](const auto& instance) { return instance.param.name; });

}  // namespace
}  // namespace stillmap::test
