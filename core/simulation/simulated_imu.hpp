#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "core/inertial/imu_sample.hpp"
#include "core/lidar/imu_mount.hpp"
#include "core/simulation/simulation.hpp"

namespace stillmap::simulation {

/// An IMU of a few euros, as lidars have them inside (such as the BMI088 or ICM-20948).
struct ImuErrors {
  double rate_hz = 200.0;
  /// Noise of a sample: standard deviations [rad/s, m/s^2].
  double gyro_noise = 0.002;
  double accelerometer_noise = 0.02;
  /// Vibration of whatever drives: acceleration for each m/s of speed [1/s].
  double vibration = 0.05;
  /// Largest constant error of an axis [rad/s, m/s^2].
  double gyro_bias = 0.008;
  double accelerometer_bias = 0.05;
};

/// What an IMU measures that sits at the lidar of a simulation, from its first scan to its end.
/// Each rate is the mean over the time between two samples, so that together they make the whole
/// rotation. Stamps are late by `mount.time_offset_s`. The same configuration gives the same
/// samples.
[[nodiscard]] std::vector<ImuSample> simulated_imu(const Simulation& simulation,
                                                   const ImuErrors& errors = {},
                                                   const ImuMount& mount = {});

}  // namespace stillmap::simulation
