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

namespace {

/// V of SE(3)'s exponential: exp(t, r) has the translation V t.
Eigen::Matrix3d left_jacobian(const Eigen::Vector3d& r) {
  const double angle = r.norm();
  const Eigen::Matrix3d k = skew(r);
  if (angle < 1e-4) return Eigen::Matrix3d::Identity() + 0.5 * k + k * k / 6.0;
  const double squared = angle * angle;
  return Eigen::Matrix3d::Identity() + (1.0 - std::cos(angle)) / squared * k +
         (angle - std::sin(angle)) / (squared * angle) * k * k;
}

}  // namespace

PoseTangent twist_of(const Eigen::Isometry3d& T) {
  const Eigen::Vector3d r = so3_log(T.linear());
  const Eigen::Matrix3d from_translation = left_jacobian(r).inverse();
  PoseTangent twist;
  twist.head<3>() = from_translation * T.translation();
  twist.tail<3>() = r;
  return twist;
}

Eigen::Isometry3d motion_of(const PoseTangent& twist) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = so3_exp(twist.tail<3>());
  T.translation() = left_jacobian(twist.tail<3>()) * twist.head<3>();
  return T;
}

Eigen::Isometry3d scaled_motion(const Eigen::Isometry3d& T, double s) {
  return motion_of(s * twist_of(T));
}

}  // namespace stillmap
