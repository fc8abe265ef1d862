#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <span>
#include <vector>

#include "core/lidar/trajectory.hpp"

namespace stillmap::evaluation {

/// True and estimated poses of the same moments, in step and in time order. Both take the same
/// body frame (lidar or camera: the caller sees to it) to their own world frame; the two world
/// frames may differ.
struct PosePairs {
  std::vector<Eigen::Isometry3d> truth;
  std::vector<Eigen::Isometry3d> estimate;

  [[nodiscard]] std::size_t size() const { return truth.size(); }
};

/// Pairs the poses one by one. Throws std::invalid_argument when the lengths differ, when there is
/// no pose, or when a pose is not finite or not a rotation; the text names which.
[[nodiscard]] PosePairs pair_by_index(std::span<const Eigen::Isometry3d> truth,
                                      std::span<const Eigen::Isometry3d> estimate);

/// Pairs every estimate with the true pose nearest in time, if it is at most `max_difference_ns`
/// away; a true pose is used once. Stamps of both must grow. Throws std::invalid_argument as
/// pair_by_index, when stamps do not grow, and when nothing pairs.
[[nodiscard]] PosePairs pair_by_stamp(const Trajectory& truth, const Trajectory& estimate,
                                      std::int64_t max_difference_ns);

/// Distance travelled up to each pose [m]; starts with 0, as long as `poses`.
[[nodiscard]] std::vector<double> distance_travelled(std::span<const Eigen::Isometry3d> poses);

/// Angle of the rotation, 0..pi [rad].
[[nodiscard]] double rotation_angle(const Eigen::Isometry3d& T);

}  // namespace stillmap::evaluation
