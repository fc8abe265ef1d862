#include "core/simulation/simulated_imu.hpp"

#include <gtest/gtest.h>

#include "core/inertial/imu_track.hpp"

namespace stillmap::simulation {
namespace {

SimulationConfig turning() {
  SimulationConfig config;
  config.plan = test_yard();
  config.scans = 60;
  config.motion = LidarMotion::hard_turns;
  return config;
}

ImuErrors exact() {
  return {
      .gyro_noise = 0.0, .accelerometer_noise = 0.0, .gyro_bias = 0.0, .accelerometer_bias = 0.0};
}

TEST(SimulatedImu, MakesTheRotationOfTheTrajectory) {
  const Simulation simulation(turning());
  const ImuMount mount{.R_lidar_imu = rotation_by({0.3, 0.2, -1.0}).toRotationMatrix(),
                       .time_offset_s = 0.01};
  ImuTrack track;
  for (const ImuSample& sample : simulated_imu(simulation, exact(), mount))
    ASSERT_EQ(track.add(sample), ImuSampleFate::taken);
  const auto R = track.rotation(1'010'000'000, 5'010'000'000, Eigen::Vector3d::Zero());
  ASSERT_TRUE(R);
  const Eigen::Quaterniond expected(mount.R_lidar_imu.transpose() *
                                    simulation.T_map_lidar_at(1.0).linear().transpose() *
                                    simulation.T_map_lidar_at(5.0).linear() * mount.R_lidar_imu);
  EXPECT_GT(expected.angularDistance(Eigen::Quaterniond::Identity()), 1.0);
  EXPECT_LT(R->angularDistance(expected), 0.001);
}

TEST(SimulatedImu, FeelsGravityAndItsOwnErrors) {
  const Simulation simulation(turning());
  const std::vector<ImuSample> samples = simulated_imu(simulation);
  ASSERT_EQ(samples.size(), 1201U);
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const ImuSample& sample : samples)
    mean += sample.acceleration_imu / static_cast<double>(samples.size());
  EXPECT_NEAR(mean.z(), 9.81, 0.1);
  // A second before it turns at all.
  Eigen::Vector3d bias = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < 200; ++k) bias += samples[k].angular_velocity_imu / 200.0;
  EXPECT_GT(bias.norm(), 0.001);
  EXPECT_LT(bias.norm(), 0.1);
  EXPECT_EQ(simulated_imu(simulation)[700].angular_velocity_imu, samples[700].angular_velocity_imu);
}

}  // namespace
}  // namespace stillmap::simulation
