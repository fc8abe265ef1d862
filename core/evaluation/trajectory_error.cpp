#include "core/evaluation/trajectory_error.hpp"

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <stdexcept>
#include <string>

#include "core/lidar/angle_units.hpp"

namespace stillmap::evaluation {
namespace {

// Poses in text files have about six digits; a matrix farther from a rotation is rejected.
constexpr double rotation_tolerance = 1e-3;

void require_pose(const Eigen::Isometry3d& T, const char* which, std::size_t index) {
  const std::string where = std::string(which) + " pose " + std::to_string(index);
  if (!T.matrix().allFinite()) {
    throw std::invalid_argument(where + " holds a value that is not finite");
  }
  const Eigen::Matrix3d R = T.linear();
  const double departure = (R * R.transpose() - Eigen::Matrix3d::Identity()).norm();
  if (departure > rotation_tolerance || R.determinant() < 0.0) {
    throw std::invalid_argument(where + " is not a rotation and a translation: R R^T is " +
                                std::to_string(departure) + " away from identity");
  }
}

void require_growing_stamps(const Trajectory& poses, const char* which) {
  for (std::size_t i = 1; i < poses.size(); ++i) {
    if (poses[i].stamp_ns <= poses[i - 1].stamp_ns) {
      throw std::invalid_argument("stamp of " + std::string(which) + " pose " + std::to_string(i) +
                                  " (" + std::to_string(poses[i].stamp_ns) +
                                  " ns) does not come after the one before it");
    }
  }
}

/// Between poses; infinite of fewer than two.
double mean_period_ns(const Trajectory& poses) {
  if (poses.size() < 2) return std::numeric_limits<double>::infinity();
  return static_cast<double>(poses.back().stamp_ns - poses.front().stamp_ns) /
         static_cast<double>(poses.size() - 1);
}

}  // namespace

PosePairs pair_by_index(std::span<const Eigen::Isometry3d> truth,
                        std::span<const Eigen::Isometry3d> estimate) {
  if (truth.size() != estimate.size()) {
    throw std::invalid_argument("truth has " + std::to_string(truth.size()) +
                                " poses and the estimate " + std::to_string(estimate.size()) +
                                ": they cannot be paired by index");
  }
  if (truth.empty()) throw std::invalid_argument("there are no poses to compare");
  for (std::size_t i = 0; i < truth.size(); ++i) {
    require_pose(truth[i], "true", i);
    require_pose(estimate[i], "estimated", i);
  }
  return {.truth = {truth.begin(), truth.end()}, .estimate = {estimate.begin(), estimate.end()}};
}

PosePairs pair_by_stamp(const Trajectory& truth, const Trajectory& estimate,
                        std::int64_t max_difference_ns) {
  require_growing_stamps(truth, "true");
  require_growing_stamps(estimate, "estimated");
  // Of the denser one each pose of the other takes the nearest. The other way round a pose would
  // take what is nearest to the next one.
  const bool is_truth_denser = mean_period_ns(truth) <= mean_period_ns(estimate);
  const Trajectory& sparse = is_truth_denser ? estimate : truth;
  const Trajectory& dense = is_truth_denser ? truth : estimate;
  const auto apart = [](const StampedPose& a, const StampedPose& b) {
    return std::abs(a.stamp_ns - b.stamp_ns);
  };
  PosePairs pairs;
  std::size_t next = 0;
  for (const StampedPose& pose : sparse) {
    std::size_t nearest = next;
    while (nearest + 1 < dense.size() &&
           apart(dense[nearest + 1], pose) < apart(dense[nearest], pose)) {
      ++nearest;
    }
    if (nearest >= dense.size() || apart(dense[nearest], pose) > max_difference_ns) continue;
    const StampedPose& other = dense[nearest];
    pairs.truth.push_back((is_truth_denser ? other : pose).T_map_lidar);
    pairs.estimate.push_back((is_truth_denser ? pose : other).T_map_lidar);
    next = nearest + 1;
  }
  if (pairs.size() == 0) {
    throw std::invalid_argument("no estimated pose lies within " +
                                std::to_string(max_difference_ns) + " ns of a true one");
  }
  return pair_by_index(pairs.truth, pairs.estimate);
}

std::vector<double> distance_travelled(std::span<const Eigen::Isometry3d> poses) {
  std::vector<double> distance_m(poses.size(), 0.0);
  for (std::size_t i = 1; i < poses.size(); ++i) {
    distance_m[i] =
        distance_m[i - 1] + (poses[i].translation() - poses[i - 1].translation()).norm();
  }
  return distance_m;
}

double rotation_angle(const Eigen::Isometry3d& T) {
  return Eigen::AngleAxisd(Eigen::Quaterniond(T.linear()).normalized()).angle();
}

namespace {

// Least squares over rotations, Umeyama eq. 40-41 with scale 1. For poses on a line the rotation
// about that line is undetermined; every choice gives the same error.
Eigen::Isometry3d best_rigid_fit(const PosePairs& pairs) {
  Eigen::Vector3d truth_mean = Eigen::Vector3d::Zero();
  Eigen::Vector3d estimate_mean = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    truth_mean += pairs.truth[i].translation();
    estimate_mean += pairs.estimate[i].translation();
  }
  truth_mean /= static_cast<double>(pairs.size());
  estimate_mean /= static_cast<double>(pairs.size());

  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    covariance += (pairs.truth[i].translation() - truth_mean) *
                  (pairs.estimate[i].translation() - estimate_mean).transpose();
  }
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance,
                                              Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double handedness = (svd.matrixU() * svd.matrixV().transpose()).determinant();

  Eigen::Isometry3d T_truth_estimate = Eigen::Isometry3d::Identity();
  T_truth_estimate.linear() =
      svd.matrixU() * Eigen::Vector3d(1.0, 1.0, handedness < 0.0 ? -1.0 : 1.0).asDiagonal() *
      svd.matrixV().transpose();
  T_truth_estimate.translation() = truth_mean - T_truth_estimate.linear() * estimate_mean;
  return T_truth_estimate;
}

Eigen::Isometry3d find_alignment(const PosePairs& pairs, Alignment alignment) {
  switch (alignment) {
    case Alignment::first_pose:
      return pairs.truth.front() * pairs.estimate.front().inverse();
    case Alignment::rigid:
      return best_rigid_fit(pairs);
    case Alignment::none:
      break;
  }
  return Eigen::Isometry3d::Identity();
}

}  // namespace

AbsoluteTrajectoryError absolute_trajectory_error(const PosePairs& pairs, Alignment alignment) {
  AbsoluteTrajectoryError error;
  error.T_truth_estimate = find_alignment(pairs, alignment);
  error.per_pose_m.reserve(pairs.size());
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    const Eigen::Vector3d aligned = error.T_truth_estimate * pairs.estimate[i].translation();
    error.per_pose_m.push_back((aligned - pairs.truth[i].translation()).norm());
  }
  const std::vector<double>& all = error.per_pose_m;
  const auto count = static_cast<double>(all.size());
  error.rmse_m = std::sqrt(std::inner_product(all.begin(), all.end(), all.begin(), 0.0) / count);
  error.mean_m = std::accumulate(all.begin(), all.end(), 0.0) / count;
  error.max_m = *std::max_element(all.begin(), all.end());
  error.final_m = all.back();
  return error;
}

namespace {

constexpr std::array segment_lengths_m{100.0, 200.0, 300.0, 400.0, 500.0, 600.0, 700.0, 800.0};
constexpr std::size_t poses_between_segments = 10;

// The true motion from pose `first` to pose `last` relative to the estimated one.
Eigen::Isometry3d motion_error(const PosePairs& pairs, std::size_t first, std::size_t last) {
  const Eigen::Isometry3d estimated = pairs.estimate[first].inverse() * pairs.estimate[last];
  const Eigen::Isometry3d true_motion = pairs.truth[first].inverse() * pairs.truth[last];
  return estimated.inverse() * true_motion;
}

// Sums over the segments of one length; the caller divides by their number.
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
