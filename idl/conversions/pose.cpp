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
Vector to_vector(const Eigen::Vector3d& v) {
  Vector out;
  out.x(v.x());
  out.y(v.y());
  out.z(v.z());
  return out;
}

// Nothing when a number is not finite or the quaternion has no length.
template <typename Vector>
std::optional<Eigen::Isometry3d> isometry(const Vector& p,
                                          const geometry_msgs::msg::Quaternion& o) {
  const Eigen::Vector3d translation(p.x(), p.y(), p.z());
  const Eigen::Quaterniond rotation(o.w(), o.x(), o.y(), o.z());
  if (!translation.allFinite() || !rotation.coeffs().allFinite() ||
      rotation.norm() < shortest_quaternion) {
    return std::nullopt;
  }
  return Eigen::Isometry3d(Eigen::Translation3d(translation) * rotation.normalized());
}

}  // namespace

geometry_msgs::msg::Pose to_pose(const Eigen::Isometry3d& T) {
  geometry_msgs::msg::Pose pose;
  pose.position(to_vector<geometry_msgs::msg::Point>(T.translation()));
  pose.orientation(to_quaternion<geometry_msgs::msg::Quaternion>(T));
  return pose;
}

std::optional<Eigen::Isometry3d> to_isometry(const geometry_msgs::msg::Pose& pose) {
  return isometry(pose.position(), pose.orientation());
}

nav_msgs::msg::Odometry to_odometry(const StampedPose& pose, const Matrix6& covariance,
                                    const std::string& frame, const std::string& child_frame,
                                    const Eigen::Matrix<double, 6, 1>& velocity) {
  nav_msgs::msg::Odometry odom;
  odom.header(to_header(pose.stamp_ns, frame));
  odom.child_frame_id(child_frame);
  odom.pose().pose(to_pose(pose.T_map_lidar));
  RowMajor6::Map(odom.pose().covariance().data()) = covariance;
  odom.twist().twist().linear(to_vector<geometry_msgs::msg::Vector3>(velocity.head<3>()));
  odom.twist().twist().angular(to_vector<geometry_msgs::msg::Vector3>(velocity.tail<3>()));
  return odom;
}

std::optional<PoseWithCovariance> from_odometry(const nav_msgs::msg::Odometry& odom) {
  const auto stamp = stamp_ns(odom.header().stamp());
  const auto T_map_lidar = to_isometry(odom.pose().pose());
  if (!stamp || !T_map_lidar) return std::nullopt;
  return PoseWithCovariance{.pose = {.stamp_ns = *stamp, .T_map_lidar = *T_map_lidar},
                            .covariance = RowMajor6::Map(odom.pose().covariance().data())};
}

tf2_msgs::msg::TFMessage to_tf(std::int64_t stamp_ns,
                               const std::vector<FrameTransform>& transforms) {
  tf2_msgs::msg::TFMessage message;
  for (const FrameTransform& transform : transforms) {
    const Eigen::Isometry3d& T = transform.T_parent_child;
    geometry_msgs::msg::TransformStamped& out = message.transforms().emplace_back();
    out.header(to_header(stamp_ns, transform.parent));
    out.child_frame_id(transform.child);
    out.transform().translation(to_vector<geometry_msgs::msg::Vector3>(T.translation()));
    out.transform().rotation(to_quaternion<geometry_msgs::msg::Quaternion>(T));
  }
  return message;
}

std::vector<FrameTransform> from_tf(const tf2_msgs::msg::TFMessage& message) {
  std::vector<FrameTransform> transforms;
  for (const geometry_msgs::msg::TransformStamped& in : message.transforms()) {
    const auto T = isometry(in.transform().translation(), in.transform().rotation());
    if (T) transforms.push_back({in.header().frame_id(), in.child_frame_id(), *T});
  }
  return transforms;
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
