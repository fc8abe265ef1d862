#include "core/evaluation/relative_pose_error.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace stillmap::evaluation {
namespace {

constexpr std::array segment_lengths_m{100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0};
constexpr std::size_t poses_between_segments = 10;
constexpr double deg_per_rad = 180.0 / std::numbers::pi;

// Sums, not yet means, so that lengths can be added up.
KittiLengthError sum_segments(const PosePairs& pairs, const std::vector<double>& distance_m,
                              double length_m) {
  KittiLengthError sum{.length_m = length_m};
  for (std::size_t first = 0; first < pairs.size(); first += poses_between_segments) {
    const auto end =
        std::upper_bound(distance_m.begin(), distance_m.end(), distance_m[first] + length_m);
    if (end == distance_m.end()) break;
    const auto last = static_cast<std::size_t>(end - distance_m.begin());
    const Eigen::Isometry3d error = motion_error(pairs, first, last);
    sum.segments += 1;
    sum.translation_percent += 100.0 * error.translation().norm() / length_m;
    sum.rotation_deg_per_100m += 100.0 * deg_per_rad * rotation_angle(error) / length_m;
  }
  return sum;
}

}  // namespace

Eigen::Isometry3d motion_error(const PosePairs& pairs, std::size_t first, std::size_t last) {
  const Eigen::Isometry3d estimated = pairs.estimate[first].inverse() * pairs.estimate[last];
  const Eigen::Isometry3d true_motion = pairs.truth[first].inverse() * pairs.truth[last];
  return estimated.inverse() * true_motion;
}

std::optional<RelativePoseError> relative_pose_error(const PosePairs& pairs) {
  if (pairs.size() < 2) return std::nullopt;
  RelativePoseError error;
  double squares = 0.0;
  for (std::size_t i = 1; i < pairs.size(); ++i) {
    const Eigen::Isometry3d step = motion_error(pairs, i - 1, i);
    const double translation_m = step.translation().norm();
    const double rotation_rad = rotation_angle(step);
    error.mean_translation_m += translation_m;
    error.mean_rotation_rad += rotation_rad;
    error.max_translation_m = std::max(error.max_translation_m, translation_m);
    error.max_rotation_rad = std::max(error.max_rotation_rad, rotation_rad);
    squares += translation_m * translation_m;
  }
  const auto steps = static_cast<double>(pairs.size() - 1);
  error.mean_translation_m /= steps;
  error.mean_rotation_rad /= steps;
  error.rmse_translation_m = std::sqrt(squares / steps);
  return error;
}

std::optional<KittiOdometryError> kitti_odometry_error(const PosePairs& pairs) {
  const std::vector<double> distance_m = distance_travelled(pairs.truth);
  KittiOdometryError error;
  for (const double length_m : segment_lengths_m) {
    KittiLengthError of_length = sum_segments(pairs, distance_m, length_m);
    if (of_length.segments == 0) continue;
    error.segments += of_length.segments;
    error.translation_percent += of_length.translation_percent;
    error.rotation_deg_per_100m += of_length.rotation_deg_per_100m;
    of_length.translation_percent /= static_cast<double>(of_length.segments);
    of_length.rotation_deg_per_100m /= static_cast<double>(of_length.segments);
    error.by_length.push_back(of_length);
  }
  if (error.segments == 0) return std::nullopt;
  error.translation_percent /= static_cast<double>(error.segments);
  error.rotation_deg_per_100m /= static_cast<double>(error.segments);
  return error;
}

}  // namespace stillmap::evaluation
