#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <string>

#include "core/lidar/trajectory.hpp"
#include "core/odometry/odometry_state.hpp"
#include "nav_msgs.h"
#include "tf2_msgs.h"

namespace stillmap::wire {

[[nodiscard]] geometry_msgs::msg::Pose to_pose(const Eigen::Isometry3d& T);

/// Nothing when a number is not finite or the quaternion has no length.
[[nodiscard]] std::optional<Eigen::Isometry3d> to_isometry(const geometry_msgs::msg::Pose& pose);

/// header.frame_id is the map's frame, child_frame_id the lidar's. The covariance is of (x, y, z,
/// rotation about x, y, z) in the map frame, as ROS 2 orders it; twist is not estimated.
[[nodiscard]] nav_msgs::msg::Odometry to_odometry(const StampedPose& pose,
                                                  const Eigen::Matrix<double, 6, 6>& covariance,
                                                  const std::string& map_frame,
                                                  const std::string& lidar_frame);

struct PoseWithCovariance {
  StampedPose pose;
  Eigen::Matrix<double, 6, 6> covariance;
};

/// Nothing when the pose or the stamp cannot be used.
[[nodiscard]] std::optional<PoseWithCovariance> from_odometry(const nav_msgs::msg::Odometry& odom);

/// The transform from `lidar_frame` to `map_frame` at the pose's stamp.
[[nodiscard]] tf2_msgs::msg::TFMessage to_tf(const StampedPose& pose, const std::string& map_frame,
                                             const std::string& lidar_frame);

[[nodiscard]] nav_msgs::msg::Path to_path(const Trajectory& trajectory,
                                          const std::string& map_frame);

/// Poses that cannot be used are left out.
[[nodiscard]] Trajectory from_path(const nav_msgs::msg::Path& path);

}  // namespace stillmap::wire
