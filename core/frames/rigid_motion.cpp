#include "core/frames/rigid_motion.hpp"

#include "core/odometry/se3.hpp"

namespace stillmap {

Eigen::Isometry3d from_xyz_rpy(const Eigen::Vector3d& translation_m,
                               const Eigen::Vector3d& roll_pitch_yaw) {
  return Eigen::Translation3d(translation_m) *
         (Eigen::AngleAxisd(roll_pitch_yaw.z(), Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(roll_pitch_yaw.y(), Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(roll_pitch_yaw.x(), Eigen::Vector3d::UnitX()));
}

Eigen::Isometry3d motion_of_frame(const Eigen::Isometry3d& T_a_b,
                                  const Eigen::Isometry3d& T_b_before_after) {
  return T_a_b * T_b_before_after * T_a_b.inverse();
}

Eigen::Matrix<double, 6, 6> covariance_of_frame(const Eigen::Matrix<double, 6, 6>& covariance_a,
                                                const Eigen::Isometry3d& T_map_a,
                                                const Eigen::Isometry3d& T_a_b) {
  // A rotation error of a swings b's origin about a's.
  Eigen::Matrix<double, 6, 6> jacobian = Eigen::Matrix<double, 6, 6>::Identity();
  jacobian.topRightCorner<3, 3>() = -skew(T_map_a.linear() * T_a_b.translation());
  return jacobian * covariance_a * jacobian.transpose();
}

Eigen::Matrix<double, 6, 6> turned_covariance(const Eigen::Matrix<double, 6, 6>& covariance_b,
                                              const Eigen::Matrix3d& R_a_b) {
  Eigen::Matrix<double, 6, 6> turn = Eigen::Matrix<double, 6, 6>::Zero();
  turn.topLeftCorner<3, 3>() = R_a_b;
  turn.bottomRightCorner<3, 3>() = R_a_b;
  return turn * covariance_b * turn.transpose();
}

}  // namespace stillmap
