#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <cstddef>
#include <vector>

namespace stillmap::test {

using Path = std::vector<Eigen::Isometry3d>;

inline Eigen::Isometry3d pose(double x, double y, double z, double yaw = 0.0) {
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.translate(Eigen::Vector3d(x, y, z));
  T.rotate(Eigen::AngleAxisd(yaw, Eigen::Vector3d::UnitZ()));
  return T;
}

/// `count` poses, `step_m` apart, along x.
inline Path straight(std::size_t count, double step_m) {
  Path path;
  for (std::size_t i = 0; i < count; ++i) {
    path.push_back(pose(step_m * static_cast<double>(i), 0.0, 0.0));
  }
  return path;
}

/// A bent path with height: its points do not lie on a line or plane.
inline Path winding(std::size_t count) {
  Path path;
  for (std::size_t i = 0; i < count; ++i) {
    const double t = 0.1 * static_cast<double>(i);
    path.push_back(
        pose(10.0 * t, 5.0 * std::sin(t), std::cos(0.7 * t), std::atan(0.5 * std::cos(t))));
  }
  return path;
}

/// Every pose of the path as seen from another world frame.
inline Path moved(const Eigen::Isometry3d& T_other_world, const Path& path) {
  Path result;
  for (const Eigen::Isometry3d& T : path) result.push_back(T_other_world * T);
  return result;
}

}  // namespace stillmap::test
