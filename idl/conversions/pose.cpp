#include "idl/conversions/pose.hpp"

#include <algorithm>

#include "idl/conversions/header.hpp"

namespace stillmap::wire {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using RowMajor6 = Eigen::Matrix<double, 6, 6, Eigen::RowMajor>;

constexpr double shortest_quaternion = 1e-6;

template <typename Quaternion>
Quaternion to_quaternion(const Eigen::Isometry3d& T) {
  const Eigen::Quaterniond q(T.rotation());
  Quaternion out;
  out.x(q.x());
  out.y(q.y());
  out.z(q.z());
  out.w(q.w());
  return out;
}

template <typename Vector>
Vector to_vector(const Eigen::Isometry3d& T) {
  Vector out;
  out.x(T.translation().x());
  out.y(T.translation().y());
  out.z(T.translation().z());
  return out;
}

}  // namespace

geometry_msgs::msg::Pose to_pose(const Eigen::Isometry3d& T) {
  geometry_msgs::msg::Pose pose;
  pose.position(to_vector<geometry_msgs::msg::Point>(T));
  pose.orientation(to_quaternion<geometry_msgs::msg::Quaternion>(T));
  return pose;
}

std::optional<Eigen::Isometry3d> to_isometry(const geometry_msgs::msg::Pose& pose) {
  const auto& p = pose.position();
  const auto& o = pose.orientation();
  const Eigen::Vector3d translation(p.x(), p.y(), p.z());
  const Eigen::Quaterniond rotation(o.w(), o.x(), o.y(), o.z());
  if (!translation.allFinite() || !rotation.coeffs().allFinite() ||
      rotation.norm() < shortest_quaternion) {
    return std::nullopt;
  }
  return Eigen::Isometry3d(Eigen::Translation3d(translation) * rotation.normalized());
}

nav_msgs::msg::Odometry to_odometry(const StampedPose& pose, const Matrix6& covariance,
                                    const std::string& map_frame, const std::string& lidar_frame) {
  nav_msgs::msg::Odometry odom;
  odom.header(to_header(pose.stamp_ns, map_frame));
  odom.child_frame_id(lidar_frame);
  odom.pose().pose(to_pose(pose.T_map_lidar));
  RowMajor6::Map(odom.pose().covariance().data()) = covariance;
  return odom;
}

std::optional<PoseWithCovariance> from_odometry(const nav_msgs::msg::Odometry& odom) {
  const auto stamp = stamp_ns(odom.header().stamp());
  const auto T_map_lidar = to_isometry(odom.pose().pose());
  if (!stamp || !T_map_lidar) return std::nullopt;
  return PoseWithCovariance{.pose = {.stamp_ns = *stamp, .T_map_lidar = *T_map_lidar},
                            .covariance = RowMajor6::Map(odom.pose().covariance().data())};
}

tf2_msgs::msg::TFMessage to_tf(const StampedPose& pose, const std::string& map_frame,
                               const std::string& lidar_frame) {
  geometry_msgs::msg::TransformStamped transform;
  transform.header(to_header(pose.stamp_ns, map_frame));
  transform.child_frame_id(lidar_frame);
  transform.transform().translation(to_vector<geometry_msgs::msg::Vector3>(pose.T_map_lidar));
  transform.transform().rotation(to_quaternion<geometry_msgs::msg::Quaternion>(pose.T_map_lidar));
  tf2_msgs::msg::TFMessage message;
  message.transforms().push_back(transform);
  return message;
}

nav_msgs::msg::Path to_path(const Trajectory& trajectory, const std::string& map_frame) {
  nav_msgs::msg::Path path;
  path.header(to_header(trajectory.empty() ? 0 : trajectory.back().stamp_ns, map_frame));
  path.poses().reserve(trajectory.size());
  for (const StampedPose& pose : trajectory) {
    auto& stamped = path.poses().emplace_back();
    stamped.header(to_header(pose.stamp_ns, map_frame));
    stamped.pose(to_pose(pose.T_map_lidar));
  }
  return path;
}

Trajectory from_path(const nav_msgs::msg::Path& path) {
  Trajectory trajectory;
  trajectory.reserve(path.poses().size());
  for (const auto& stamped : path.poses()) {
    const auto stamp = stamp_ns(stamped.header().stamp());
    const auto T_map_lidar = to_isometry(stamped.pose());
    if (stamp && T_map_lidar) trajectory.push_back({*stamp, *T_map_lidar});
  }
  return trajectory;
}

}  // namespace stillmap::wire
