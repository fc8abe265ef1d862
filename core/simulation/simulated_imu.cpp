#include "core/simulation/simulated_imu.hpp"

#include <algorithm>
#include <cmath>

#include "core/simulation/random.hpp"

namespace stillmap::simulation {
namespace {

constexpr double gravity_m_s2 = 9.81;
/// Accelerations are seen over this time: an accelerometer is a low-pass filter.
constexpr double acceleration_window_s = 0.02;

Eigen::Vector3d random_vector(Random& random) {
  const double x = random.normal();
  const double y = random.normal();
  return {x, y, random.normal()};
}

/// Along the lidar's axes.
Eigen::Vector3d true_rate(const Simulation& simulation, double time_s, double step_s) {
  const double from_s = std::max(0.0, time_s - 0.5 * step_s);
  const double to_s = time_s + 0.5 * step_s;
  const Eigen::AngleAxisd rotation(simulation.T_map_lidar_at(from_s).linear().transpose() *
                                   simulation.T_map_lidar_at(to_s).linear());
  return rotation.angle() * rotation.axis() / (to_s - from_s);
}

Eigen::Vector3d true_acceleration(const Simulation& simulation, double time_s) {
  const double middle_s = std::max(time_s, acceleration_window_s);
  const auto position = [&](double t) -> Eigen::Vector3d {
    return simulation.T_map_lidar_at(t).translation();
  };
  const Eigen::Vector3d acceleration_map =
      (position(middle_s + acceleration_window_s) - 2.0 * position(middle_s) +
       position(middle_s - acceleration_window_s)) /
      (acceleration_window_s * acceleration_window_s);
  return simulation.T_map_lidar_at(time_s).linear().transpose() *
         (acceleration_map + gravity_m_s2 * Eigen::Vector3d::UnitZ());
}

double speed_at(const Simulation& simulation, double time_s) {
  constexpr double window_s = 0.1;
  const Eigen::Vector3d from = simulation.T_map_lidar_at(time_s).translation();
  return (simulation.T_map_lidar_at(time_s + window_s).translation() - from).norm() / window_s;
}

}  // namespace

std::vector<ImuSample> simulated_imu(const Simulation& simulation, const ImuErrors& errors,
                                     const ImuMount& mount) {
  const SimulationConfig& config = simulation.config();
  // Of the device, the same every day.
  Random constant(config.seed, 51);
  const auto bias = [&](double largest) {
    return Eigen::Vector3d(constant.uniform(-largest, largest), constant.uniform(-largest, largest),
                           constant.uniform(-largest, largest));
  };
  const Eigen::Vector3d gyro_bias = bias(errors.gyro_bias);
  const Eigen::Vector3d accelerometer_bias = bias(errors.accelerometer_bias);
  const double step_s = 1.0 / errors.rate_hz;
  const auto count = static_cast<std::uint64_t>(config.scans * config.sensor.period_s / step_s);
  const Eigen::Matrix3d R_imu_lidar = mount.R_lidar_imu.transpose();
  std::vector<ImuSample> samples;
  samples.reserve(count);
  for (std::uint64_t k = 0; k <= count; ++k) {
    Random random(config.day_seed(), 52, k);
    const double time_s = static_cast<double>(k) * step_s;
    ImuSample sample;
    sample.stamp_ns = std::llround((time_s + mount.time_offset_s) * 1e9);
    sample.angular_velocity_imu = R_imu_lidar * true_rate(simulation, time_s, step_s) + gyro_bias +
                                  errors.gyro_noise * random_vector(random);
    sample.acceleration_imu =
        R_imu_lidar * true_acceleration(simulation, time_s) + accelerometer_bias +
        (errors.accelerometer_noise + errors.vibration * speed_at(simulation, time_s)) *
            random_vector(random);
    samples.push_back(sample);
  }
  return samples;
}

}  // namespace stillmap::simulation
