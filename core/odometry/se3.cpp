#include "core/odometry/se3.hpp"

#include <cmath>

namespace stillmap {

Eigen::Matrix3d skew(const Eigen::Vector3d& v) {
  Eigen::Matrix3d m;
  m << 0.0, -v.z(), v.y(), v.z(), 0.0, -v.x(), -v.y(), v.x(), 0.0;
  return m;
}

Eigen::Matrix3d so3_exp(const Eigen::Vector3d& omega) {
  const double angle = omega.norm();
  if (angle < 1e-9) return Eigen::Matrix3d::Identity() + skew(omega);
  return Eigen::AngleAxisd(angle, omega / angle).toRotationMatrix();
}

Eigen::Vector3d so3_log(const Eigen::Matrix3d& rotation) {
  const Eigen::AngleAxisd angle_axis(rotation);
  const double angle = angle_axis.angle();
  return (angle > M_PI ? angle - 2.0 * M_PI : angle) * angle_axis.axis();
}

Eigen::Isometry3d boxplus(const Eigen::Isometry3d& T, const PoseTangent& xi) {
  Eigen::Isometry3d moved = Eigen::Isometry3d::Identity();
  // Through a quaternion, so that rounding never adds up to a matrix that is no rotation.
  moved.linear() = Eigen::Quaterniond(so3_exp(xi.tail<3>()) * T.linear()).normalized().matrix();
  moved.translation() = T.translation() + xi.head<3>();
  return moved;
}

PoseTangent boxminus(const Eigen::Isometry3d& b, const Eigen::Isometry3d& a) {
  PoseTangent xi;
  xi.head<3>() = b.translation() - a.translation();
  xi.tail<3>() = so3_log(b.linear() * a.linear().transpose());
  return xi;
}

Eigen::Isometry3d scaled_motion(const Eigen::Isometry3d& T, double s) {
  Eigen::Isometry3d scaled = Eigen::Isometry3d::Identity();
  scaled.linear() = so3_exp(s * so3_log(T.linear()));
  scaled.translation() = s * T.translation();
  return scaled;
}

}  // namespace stillmap
