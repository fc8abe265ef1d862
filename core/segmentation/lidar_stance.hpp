#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

namespace stillmap {

/// How a lidar stands over the ground that it sees.
struct LidarStance {
  /// Turns points to axes whose z is the normal of the ground; not about z.
  Eigen::Matrix3d R_level_lidar = Eigen::Matrix3d::Identity();
  /// Between the lidar's z axis and that normal [rad].
  double tilt_rad = 0.0;
  /// Of the lidar above the ground [m].
  double height_m = 0.0;
};

/// A lean that nobody told and the ground shows counts from here on. Less costs little, and lidars
/// that count as upright lean by 2 degrees against the road, by 3 where it begins to rise.
inline constexpr double least_seen_tilt_rad = 0.07;

/// Whether these points lie at fewer elevations than those, the same ones along other axes: whether
/// the beams that measured them have rows along these axes rather than along those.
[[nodiscard]] bool has_fewer_elevations(std::span<const Eigen::Vector3f> these,
                                        std::span<const Eigen::Vector3f> those);

/// The stance that a scan shows where its ground is one clear plane: half of what is lowest within
/// 20 m lies on it, hardly anything below it, and both halves of it, up and down its slope, are
/// parts of the same plane, without another one on one side of the lidar, and the ground beside the
/// lidar lies on it in two of three directions, and rises with it across its level line through the
/// lidar's foot. So neither a change of grade ahead, as at the foot of a hill, nor a bank beside
/// the road counts as a tilt, nor do fields below the road as its ground, nor the slope that a
/// level lane is cut into, and the tilt is that against the road, not against gravity. Nothing in
/// other places, for a lidar that leans by more than 30 degrees, and for one on the ground, where
/// the origin of a robot may be.
[[nodiscard]] std::optional<LidarStance> stance_over_ground(
    std::span<const Eigen::Vector3f> points_lidar);

}  // namespace stillmap
