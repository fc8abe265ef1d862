#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <optional>
#include <vector>

#include "core/mapper.hpp"
#include "core/segmentation/segmenter.hpp"
#include "core/simulation/simulated_imu.hpp"

namespace stillmap {
namespace {

using simulation::LidarMotion;
using simulation::Simulation;
using simulation::SimulationConfig;

SimulationConfig turning_yard() {
  SimulationConfig config;
  config.plan = simulation::test_yard();
  config.seed = 5;
  config.sensor = hdl_32e();
  config.firings = 900;
  config.scans = 80;
  config.rolling = true;
  config.motion = LidarMotion::handheld;
  return config;
}

struct InertialDrive {
  std::vector<Eigen::Isometry3d> poses;
  InertialCounts counts;
};

/// Every scan comes with the samples of its sweep, as far as they are `true`.
InertialDrive drive(const Simulation& simulation, const std::vector<ImuSample>& samples) {
  MapperConfig config;
  config.sensor = simulation.config().sensor;
  config.sensor.imu = ImuMount{};
  Mapper mapper(config, std::make_unique<PassthroughSegmenter>());
  InertialDrive result;
  std::size_t next = 0;
  for (int k = 0; k < simulation.config().scans; ++k) {
    Scan scan = simulation.scan(k).scan;
    const std::int64_t end_ns = scan.stamp_ns + 120'000'000;
    while (next < samples.size() && samples[next].stamp_ns <= end_ns) mapper.add(samples[next++]);
    const auto mapped = mapper.process(std::move(scan));
    if (!mapped) break;
    result.poses.push_back(mapped->odometry.T_map_lidar);
  }
  result.counts = mapper.inertial().counts();
  return result;
}

/// Root mean square error of the rotation from scan to scan [rad].
double rotation_error(const Simulation& simulation, const std::vector<Eigen::Isometry3d>& poses) {
  double squares = 0.0;
  const double period_s = simulation.config().sensor.period_s;
  for (std::size_t k = 1; k < poses.size(); ++k) {
    const auto now_s = static_cast<double>(k) * period_s;
    const Eigen::Matrix3d step = simulation.T_map_lidar_at(now_s - period_s).linear().transpose() *
                                 simulation.T_map_lidar_at(now_s).linear();
    const Eigen::Matrix3d found = poses[k - 1].linear().transpose() * poses[k].linear();
    squares += std::pow(Eigen::AngleAxisd(step.transpose() * found).angle(), 2);
  }
  return std::sqrt(squares / static_cast<double>(poses.size() - 1));
}

std::vector<ImuSample> changed(std::vector<ImuSample> samples,
                               const std::function<void(std::size_t, ImuSample&)>& change) {
  for (std::size_t k = 0; k < samples.size(); ++k) change(k, samples[k]);
  return samples;
}

TEST(InertialDrives, GyroHelpsAHandheldLidarAndAWrongOneDoesNoHarm) {
  const Simulation simulation(turning_yard());
  const std::vector<ImuSample> imu = simulated_imu(simulation);
  const double without = rotation_error(simulation, drive(simulation, {}).poses);

  const InertialDrive with = drive(simulation, imu);
  ASSERT_EQ(with.poses.size(), 80U);
  EXPECT_GT(with.counts.scans_helped, 50U);
  EXPECT_EQ(with.counts.trust_losses, 0U);
  EXPECT_LT(rotation_error(simulation, with.poses), 0.6 * without);

  const InertialDrive in_degrees =
      drive(simulation,
            changed(imu, [](std::size_t, ImuSample& s) { s.angular_velocity_imu *= 57.2958; }));
  EXPECT_EQ(in_degrees.counts.scans_helped, 0U);
  EXPECT_LT(rotation_error(simulation, in_degrees.poses), 1.05 * without);

  // Frozen at an instant of fast motion.
  const InertialDrive frozen = drive(simulation, changed(imu, [&](std::size_t k, ImuSample& s) {
                                       if (k <= 600) return;
                                       s.angular_velocity_imu = imu[600].angular_velocity_imu;
                                       s.acceleration_imu = imu[600].acceleration_imu;
                                     }));
  ASSERT_EQ(frozen.poses.size(), 80U);
  EXPECT_GT(frozen.counts.scans_without_samples + frozen.counts.trust_losses, 0U);
  EXPECT_LT(rotation_error(simulation, frozen.poses), 1.1 * without);
}

TEST(InertialDrives, ALidarThatLeansMakesALevelMap) {
  SimulationConfig leaning = turning_yard();
  leaning.motion = LidarMotion::vehicle;
  leaning.scans = 3;
  leaning.flaws.roll = 0.15;
  leaning.flaws.pitch = -0.1;
  const Simulation simulation(leaning);
  const InertialDrive with = drive(simulation, simulated_imu(simulation));
  ASSERT_EQ(with.poses.size(), 3U);
  const auto tilt = [&](const Eigen::Isometry3d& T_map_lidar) {
    const Eigen::Vector3d up_lidar =
        simulation.T_map_lidar_at(0.0).linear().transpose() * Eigen::Vector3d::UnitZ();
    return std::acos((T_map_lidar.linear() * up_lidar).z());
  };
  EXPECT_LT(tilt(with.poses.front()), 0.01);
  EXPECT_GT(tilt(drive(simulation, {}).poses.front()), 0.1);
}

}  // namespace
}  // namespace stillmap
