#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>
#include <vector>

#include "core/frames/frame_tree.hpp"
#include "core/lidar/trajectory.hpp"
#include "core/odometry/odometry_state.hpp"
#include "nav_msgs.h"
#include "tf2_msgs.h"

namespace stillmap::wire {

[[nodiscard]] geometry_msgs::msg::Pose to_pose(const Eigen::Isometry3d& T);

/// Nothing when a number is not finite or the quaternion has no length.
[[nodiscard]] std::optional<Eigen::Isometry3d> to_isometry(const geometry_msgs::msg::Pose& pose);

/// `frame` is header.frame_id. The covariance is of (x, y, z, rotation about x, y, z) along that
/// frame's axes, as ROS 2 orders it; `velocity` (m/s, rad/s) is along the child's.
[[nodiscard]] nav_msgs::msg::Odometry to_odometry(
    const StampedPose& pose, const Eigen::Matrix<double, 6, 6>& covariance,
    const std::string& frame, const std::string& child_frame,
    const Eigen::Matrix<double, 6, 1>& velocity = Eigen::Matrix<double, 6, 1>::Zero());

/// The covariance is of (x, y, z, rotation about x, y, z) along the frame's axes [m, rad].
struct PoseWithCovariance {
  StampedPose pose;
  Eigen::Matrix<double, 6, 6> covariance;
};

/// Nothing when the pose or the stamp cannot be used.
[[nodiscard]] std::optional<PoseWithCovariance> from_odometry(const nav_msgs::msg::Odometry& odom);

[[nodiscard]] tf2_msgs::msg::TFMessage to_tf(std::int64_t stamp_ns,
                                             const std::vector<FrameTransform>& transforms);

/// Transforms that cannot be used are left out.
[[nodiscard]] std::vector<FrameTransform> from_tf(const tf2_msgs::msg::TFMessage& message);

[[nodiscard]] nav_msgs::msg::Path to_path(const Trajectory& trajectory,
                                          const std::string& map_frame);

/// Poses that cannot be used are left out.
[[nodiscard]] Trajectory from_path(const nav_msgs::msg::Path& path);

}  // namespace stillmap::wire
