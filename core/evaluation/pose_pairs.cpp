#include "core/evaluation/pose_pairs.hpp"

#include <cstdlib>
#include <stdexcept>
#include <string>

namespace stillmap::evaluation {
namespace {

// Text files round to six digits or so; a matrix farther from a rotation than this is no pose.
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
  const auto apart = [](const StampedPose& a, const StampedPose& b) {
    return std::abs(a.stamp_ns - b.stamp_ns);
  };
  PosePairs pairs;
  std::size_t next = 0;
  for (const StampedPose& pose : estimate) {
    std::size_t nearest = next;
    while (nearest + 1 < truth.size() &&
           apart(truth[nearest + 1], pose) < apart(truth[nearest], pose)) {
      ++nearest;
    }
    if (nearest >= truth.size() || apart(truth[nearest], pose) > max_difference_ns) continue;
    pairs.truth.push_back(truth[nearest].T_map_lidar);
    pairs.estimate.push_back(pose.T_map_lidar);
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

}  // namespace stillmap::evaluation
