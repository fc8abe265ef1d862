#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <span>

namespace stillmap {

/// A pose of the lidar by odometry, in plan.
struct PlanPose {
  std::int64_t stamp_ns = 0;
  /// Where the antenna is as far as is known [m].
  Eigen::Vector2d antenna_odom = Eigen::Vector2d::Zero();
  /// Along these an antenna would be off that is elsewhere on the lidar along x and y.
  Eigen::Matrix2d axes_odom = Eigen::Matrix2d::Identity();
};

/// A fix, in plan.
struct PlanFix {
  std::int64_t stamp_ns = 0;
  Eigen::Vector2d position_enu = Eigen::Vector2d::Zero();
  /// East and north [m].
  double sigma_m = 1.0;
};

struct GnssDelayConfig {
  /// Receivers that send GPS time are 18 s ahead of UTC; lidars that have TAI, as by PTP, 37 s [s].
  double max_delay_s = 40.0;
  /// Standard deviation of where the antenna is, along x and y of the lidar; 0: that is known [m].
  double antenna_sigma_m = 0.0;
};

/// What stamps and antenna are off.
struct GnssDelay {
  /// Of the stamps: so much later than the robot was there [s].
  double delay_s = 0.0;
  double sigma_s = 0.0;
  /// To be added to where the antenna is on the lidar; zero where that is known [m].
  Eigen::Vector2d antenna_lidar = Eigen::Vector2d::Zero();
  double antenna_sigma_m = 0.0;
};

/// Whether two scans after each other are so far apart, in time and in what the antenna moved, that
/// nobody knows where it was between them.
[[nodiscard]] constexpr bool is_gap(std::int64_t apart_ns, double way_m) {
  constexpr std::int64_t max_apart_ns = 1'500'000'000;
  constexpr double max_way_m = 0.5;
  return apart_ns > max_apart_ns && way_m > max_way_m;
}

/// How late the stamps of a receiver are: the delay by which the fixes fit the way by odometry
/// best, stretch by stretch, so that the drift of odometry has no part in it. Only turns and
/// changes of speed tell: on a straight way at one speed, or on one circle, a delay is another
/// place of the map. Nothing while they tell too little: the delay's standard deviation, by what
/// the stretches contradict each other, is `sigma_s`. Both are in the order of their stamps.
[[nodiscard]] std::optional<GnssDelay> estimate_delay(std::span<const PlanPose> way,
                                                      std::span<const PlanFix> fixes,
                                                      const GnssDelayConfig& config = {});

/// What is used from now on, where `found` says clearly that it is not what is `known` until now;
/// else nothing. A delay or antenna that may be none is none, unless one is known already and what
/// was found does not contradict that.
[[nodiscard]] std::optional<GnssDelay> revised(const GnssDelay& known, GnssDelay found);

}  // namespace stillmap
