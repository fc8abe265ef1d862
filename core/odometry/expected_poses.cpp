#include "core/odometry/expected_poses.hpp"

#include <algorithm>
#include <cmath>

#include "core/odometry/relocalization.hpp"

namespace stillmap {
namespace {

/// Gaps longer than this are looked across from where the lidar was last, too [s].
constexpr double short_gap_s = 1.0;
/// After a gap of up to this the lidar may have gone straight on [s].
constexpr double max_gap_s = 10.0;
/// How far off its way a lidar may be after a gap of one second [m/s^2], at least and at most [m].
constexpr double gap_acceleration_m_s2 = 1.5;
constexpr double min_gap_reach_m = 3.0;
constexpr double max_gap_reach_m = 15.0;
/// After so few lost scans, so near to where its motion led [m], it was followed.
constexpr int max_missed_scans = 2;
constexpr double missed_distance_m = 0.5;

}  // namespace

std::vector<Eigen::Isometry3d> starts_without_prediction(const RegisteredScan& last,
                                                         const PosePrediction& prediction) {
  std::vector<Eigen::Isometry3d> starts{prediction.T_map_lidar};
  if (prediction.lost_scans == 0 && prediction.interval_s <= short_gap_s) return starts;
  // It cannot be back where it was once motion has led too far from there.
  const Eigen::Vector3d led_m =
      prediction.T_map_lidar.translation() - last.T_map_lidar.translation();
  if (prediction.is_led && led_m.norm() > relocalization_reach_m + prediction.driven_m)
    return starts;
  starts.push_back(last.T_map_lidar);
  // Straight on during a gap.
  if (last.interval_s > 0.0 && prediction.interval_s > 0.0 && prediction.interval_s < max_gap_s)
    starts.push_back(last.T_map_lidar *
                     scaled_motion(last.motion, prediction.interval_s / last.interval_s));
  return starts;
}

Eigen::Isometry3d nearest_expected(const Eigen::Isometry3d& T_map_lidar, const RegisteredScan& last,
                                   const PosePrediction& prediction) {
  if (prediction.is_led) return prediction.T_map_lidar;
  const std::vector<Eigen::Isometry3d> expected = starts_without_prediction(last, prediction);
  return *std::ranges::min_element(expected, {}, [&](const Eigen::Isometry3d& T) {
    return (T_map_lidar.translation() - T.translation()).norm();
  });
}

bool is_followed(const Eigen::Isometry3d& T_map_lidar,
                 const Eigen::Isometry3d& T_map_lidar_expected, const PosePrediction& prediction) {
  const double distance_m = (T_map_lidar.translation() - T_map_lidar_expected.translation()).norm();
  if (prediction.lost_scans > 0)
    return prediction.lost_scans <= max_missed_scans && distance_m < missed_distance_m;
  const double reach_m = gap_acceleration_m_s2 * std::pow(prediction.interval_s, 2);
  return distance_m < std::clamp(reach_m, min_gap_reach_m, max_gap_reach_m);
}

}  // namespace stillmap
