#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <optional>

#include "core/frames/rigid_motion.hpp"
#include "core/mapper.hpp"
#include "core/segmentation/segmenter.hpp"
#include "core/simulation/simulation.hpp"

namespace stillmap {
namespace {

using testing::HasSubstr;

constexpr double gravity_m_s2 = 9.81;

Scan scan_of_yard() {
  simulation::SimulationConfig config;
  config.plan = simulation::test_yard();
  config.sensor = hdl_32e();
  config.firings = 600;
  config.scans = 1;
  return simulation::Simulation(config).scan(0).scan;
}

struct Start {
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
  Levelling levelling;
};

/// A map that begins with this scan, while the IMU at the lidar says that this is up.
Start begun(Scan scan, const Eigen::Vector3d& up_lidar,
            const std::optional<Eigen::Isometry3d>& T_base_lidar) {
  MapperConfig config;
  config.sensor = hdl_32e();
  config.sensor.imu = ImuMount{};
  Mapper mapper(config, std::make_unique<PassthroughSegmenter>());
  if (T_base_lidar) mapper.begin_maps_at(*T_base_lidar);
  for (int k = -100; k < 60; ++k) {
    // Samples that say the same again and again are of an IMU that hangs.
    const Eigen::Vector3d noise = 1e-3 * Eigen::Vector3d(k % 3, k % 5, k % 7);
    mapper.add({.stamp_ns = scan.stamp_ns + k * 5'000'000,
                .angular_velocity_imu = noise,
                .acceleration_imu = gravity_m_s2 * up_lidar + noise});
  }
  const auto mapped = mapper.process(std::move(scan));
  EXPECT_TRUE(mapped);
  EXPECT_TRUE(mapper.levelling());
  if (!mapped || !mapper.levelling()) return {};
  return {mapped->odometry.T_map_lidar, *mapper.levelling()};
}

const Eigen::Isometry3d mount = from_xyz_rpy({0.9, 0.1, 1.2}, {0.0, 0.3, 0.0});

TEST(LevelledStart, ARobotOnASlopeBeginsALevelMap) {
  const Eigen::Isometry3d slope = from_xyz_rpy({0, 0, 0}, {0.0, -0.15, 0.0});
  const Eigen::Vector3d up_lidar = (slope * mount).linear().transpose() * Eigen::Vector3d::UnitZ();
  const Start start = begun(scan_of_yard(), up_lidar, mount);
  EXPECT_EQ(start.levelling.fault, "");
  EXPECT_TRUE(start.T_map_lidar.isApprox(slope * mount, 2e-3)) << start.T_map_lidar.matrix();
}

TEST(LevelledStart, AccelerationsThatPointDownDoNotTurnTheMapUpsideDown) {
  const Eigen::Vector3d down_lidar = -mount.linear().transpose() * Eigen::Vector3d::UnitZ();
  const Start robot = begun(scan_of_yard(), down_lidar, mount);
  EXPECT_THAT(robot.levelling.fault, HasSubstr("point down"));
  EXPECT_TRUE(robot.T_map_lidar.isApprox(mount, 1e-6));
  const Start lidar = begun(scan_of_yard(), -Eigen::Vector3d::UnitZ(), std::nullopt);
  EXPECT_THAT(lidar.levelling.fault, HasSubstr("ground in its scan"));
  EXPECT_GT(lidar.T_map_lidar.linear()(2, 2), 0.99);
}

TEST(LevelledStart, ALidarMayHangUpsideDown) {
  Scan scan = scan_of_yard();
  for (Eigen::Vector3f& point : scan.points_lidar) point = {point.x(), -point.y(), -point.z()};
  const Start start = begun(std::move(scan), -Eigen::Vector3d::UnitZ(), std::nullopt);
  EXPECT_EQ(start.levelling.fault, "");
  EXPECT_LT(start.T_map_lidar.linear()(2, 2), -0.99);
}

}  // namespace
}  // namespace stillmap
