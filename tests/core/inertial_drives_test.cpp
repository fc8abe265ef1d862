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

/// Every scan comes with the samples of its sweep, and those of two tenths of a second after it.
InertialDrive drive(const Simulation& simulation, const std::vector<ImuSample>& samples) {
  MapperConfig config;
  config.sensor = simulation.config().sensor;
  config.sensor.imu = ImuMount{};
  Mapper mapper(config, std::make_unique<PassthroughSegmenter>());
  InertialDrive result;
  std::size_t next = 0;
  for (int k = 0; k < simulation.config().scans; ++k) {
    Scan scan = simulation.scan(k).scan;
    const std::int64_t end_ns = scan.stamp_ns + 300'000'000;
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

/// What an IMU at the lidar of a simulation measures before it sets off.
std::vector<ImuSample> at_rest(const Simulation& simulation) {
  std::vector<ImuSample> samples;
  for (int k = 0; k < 60; ++k) {
    ImuSample sample;
    sample.stamp_ns = k * std::int64_t{5'000'000};
    sample.angular_velocity_imu = {0.004 + 1e-4 * (k % 3), -0.002, 1e-4 * (k % 5)};
    sample.acceleration_imu = 9.81 * simulation.T_map_lidar_at(0.0).linear().row(2).transpose();
    samples.push_back(sample);
  }
  return samples;
}

TEST(InertialDrives, ALidarThatLeansMakesALevelMapFromRestAlone) {
  SimulationConfig leaning = turning_yard();
  leaning.motion = LidarMotion::vehicle;
  leaning.scans = 2;
  leaning.flaws.roll = 0.15;
  leaning.flaws.pitch = -0.1;
  const Simulation simulation(leaning);
  const auto tilt = [&](const std::vector<ImuSample>& samples) {
    const InertialDrive drive_with = drive(simulation, samples);
    EXPECT_EQ(drive_with.poses.size(), 2U);
    const Eigen::Vector3d up_lidar = simulation.T_map_lidar_at(0.0).linear().row(2).transpose();
    return std::acos((drive_with.poses.front().linear() * up_lidar).z());
  };
  const double without = tilt({});
  EXPECT_GT(without, 0.1);
  EXPECT_LT(tilt(at_rest(simulation)), 0.005);
  // Driving off it would be wrong by an acceleration.
  EXPECT_EQ(tilt(simulated_imu(simulation)), without);
}

}  // namespace
}  // namespace stillmap
