#include "core/frames/rigid_motion.hpp"

#include <cmath>

#include "core/odometry/se3.hpp"

namespace stillmap {

Eigen::Isometry3d from_xyz_rpy(const Eigen::Vector3d& translation_m,
                               const Eigen::Vector3d& roll_pitch_yaw) {
  return Eigen::Translation3d(translation_m) *
         (Eigen::AngleAxisd(roll_pitch_yaw.z(), Eigen::Vector3d::UnitZ()) *
          Eigen::AngleAxisd(roll_pitch_yaw.y(), Eigen::Vector3d::UnitY()) *
          Eigen::AngleAxisd(roll_pitch_yaw.x(), Eigen::Vector3d::UnitX()));
}

double heading_rad(const Eigen::Isometry3d& T_parent_child) {
  return std::atan2(T_parent_child.linear()(1, 0), T_parent_child.linear()(0, 0));
}

Eigen::Matrix3d levelling_rotation(const Eigen::Vector3d& up_body) {
  const double level = up_body.head<2>().squaredNorm();
  // Upside down, any turn by half a circle about a level axis is the least.
  if (level == 0.0 && up_body.z() < 0.0)
    return Eigen::Vector3d(1.0, -1.0, -1.0).asDiagonal().toDenseMatrix();
  // (1 + a.b, a x b), without the difference of what is nearly equal. Eigen's FromTwoVectors
  // compiles a singular value decomposition wherever it is called.
  const double w = up_body.z() > 0.0 ? 1.0 + up_body.z() : level / (1.0 - up_body.z());
  const Eigen::Quaterniond q(w, up_body.y(), -up_body.x(), 0.0);
  return q.normalized().toRotationMatrix();
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
  Eigen::Matrix<double, 6, 6> covariance_a;
  for (const Eigen::Index row : {0, 3}) {
    for (const Eigen::Index column : {0, 3}) {
      covariance_a.block<3, 3>(row, column) =
          R_a_b * covariance_b.block<3, 3>(row, column) * R_a_b.transpose();
    }
  }
  return covariance_a;
}

}  // namespace stillmap
