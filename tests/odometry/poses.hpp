#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <random>

#include "core/odometry/se3.hpp"

namespace stillmap::test {

inline Eigen::Vector3d random_vector(std::mt19937& random, double max_coordinate) {
  std::uniform_real_distribution<double> coordinate(-max_coordinate, max_coordinate);
  const double x = coordinate(random);
  const double y = coordinate(random);
  return {x, y, coordinate(random)};
}

/// Any rotation by up to pi, and a translation of up to `max_coordinate_m` in each axis.
inline Eigen::Isometry3d random_pose(std::mt19937& random, double max_coordinate_m) {
  std::uniform_real_distribution<double> angle(0.0, M_PI);
  const Eigen::Vector3d axis = random_vector(random, 1.0).normalized();
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = so3_exp(angle(random) * axis);
  T.translation() = random_vector(random, max_coordinate_m);
  return T;
}

/// A pose on level ground: position [m] and yaw [rad].
inline Eigen::Isometry3d level_pose(double x, double y, double yaw) {
  return Eigen::Translation3d(x, y, 0.0) * Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ());
}

inline double translation_error(const Eigen::Isometry3d& T, const Eigen::Isometry3d& T_true) {
  return (T.translation() - T_true.translation()).norm();
}

inline double rotation_error(const Eigen::Isometry3d& T, const Eigen::Isometry3d& T_true) {
  return boxminus(T, T_true).tail<3>().norm();
}

inline void expect_near(const Eigen::Isometry3d& T, const Eigen::Isometry3d& T_true,
                        double tolerance_m, double tolerance_rad) {
  EXPECT_LE(translation_error(T, T_true), tolerance_m)
      << "at " << T.translation().transpose() << " instead of " << T_true.translation().transpose();
  EXPECT_LE(rotation_error(T, T_true), tolerance_rad);
}

}  // namespace stillmap::test
