#include "core/simulation/lidar_motion.hpp"

#include <array>
#include <cmath>
#include <numbers>
#include <stdexcept>

namespace stillmap::simulation {
namespace {

constexpr double deg = std::numbers::pi / 180.0;

/// Time since the start of a motion at rate 1 that ramps up and down within `ramp_s`, and so ends
/// `duration_s + ramp_s` after its start having advanced by `duration_s`.
double ramped(double time_s, double duration_s, double ramp_s) {
  const auto ramp_up = [ramp_s](double t) {
    if (t <= 0.0) return 0.0;
    return t < ramp_s ? 0.5 * t * t / ramp_s : t - 0.5 * ramp_s;
  };
  return ramp_up(time_s) - ramp_up(time_s - duration_s);
}

/// Quarter turns to one side and the other, with rests of uneven length between them.
double hard_turn_yaw(double time_s) {
  constexpr double rate = 55.0 * deg;
  constexpr double turn_s = 90.0 * deg / rate;
  constexpr std::array<double, 4> starts_s{2.05, 5.33, 9.71, 13.02};
  constexpr std::array<double, 4> sense{1.0, -1.0, -1.0, 1.0};
  constexpr double cycle_s = 17.0;
  const double in_cycle_s = time_s - cycle_s * std::floor(time_s / cycle_s);
  double yaw = 0.0;
  for (std::size_t k = 0; k < starts_s.size(); ++k)
    yaw += sense[k] * rate * ramped(in_cycle_s - starts_s[k], turn_s, 0.1);
  return yaw;
}

double wave(double time_s, double frequency_hz, double phase) {
  return std::sin(2.0 * std::numbers::pi * frequency_hz * time_s + phase);
}

Eigen::Isometry3d handheld_pose(double time_s) {
  // From standing still, so that the first scans are as sharp as those of a person who starts.
  const double begun = std::min(1.0, time_s / 2.0);
  const double yaw = begun * deg * (22.0 * wave(time_s, 0.31, 0.4) + 6.0 * wave(time_s, 0.9, 1.0));
  const double pitch = begun * deg * (3.0 * wave(time_s, 1.8, 0.0) + 2.0 * wave(time_s, 0.43, 2.0));
  const double roll = begun * deg * (2.5 * wave(time_s, 0.9, 0.3) + 2.0 * wave(time_s, 0.27, 1.1));
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translation() =
      begun * Eigen::Vector3d(0.02 * wave(time_s, 1.8, 0.5), 0.04 * wave(time_s, 0.9, 0.0),
                              0.03 * wave(time_s, 1.8, 1.2));
  T.linear() = (Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()) *
                Eigen::AngleAxisd(pitch, Eigen::Vector3d::UnitY()) *
                Eigen::AngleAxisd(roll, Eigen::Vector3d::UnitX()))
                   .toRotationMatrix();
  return T;
}

}  // namespace

LidarMotion lidar_motion(const std::string& name) {
  if (name == "vehicle") return LidarMotion::vehicle;
  if (name == "hard_turns") return LidarMotion::hard_turns;
  if (name == "handheld") return LidarMotion::handheld;
  throw std::invalid_argument("no lidar motion '" + name +
                              "': there are vehicle, hard_turns and handheld");
}

Eigen::Isometry3d T_vehicle_lidar_at(LidarMotion motion, double time_s) {
  switch (motion) {
    case LidarMotion::vehicle:
      break;
    case LidarMotion::hard_turns:
      return Eigen::Isometry3d(Eigen::AngleAxisd(hard_turn_yaw(time_s), Eigen::Vector3d::UnitZ()));
    case LidarMotion::handheld:
      return handheld_pose(time_s);
  }
  return Eigen::Isometry3d::Identity();
}

}  // namespace stillmap::simulation
