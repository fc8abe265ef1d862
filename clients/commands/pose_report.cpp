#include "clients/commands/pose_report.hpp"

#include <cmath>
#include <numbers>

#include "core/frames/rigid_motion.hpp"
#include "core/lidar/angle_units.hpp"

namespace stillmap::cli {

double heading_deg(const Eigen::Isometry3d& T_parent_child) {
  return heading_rad(T_parent_child) * deg_per_rad;
}

double heading_deg(const PlanarPose& pose) {
  return std::remainder(pose.heading_rad, 2.0 * std::numbers::pi) * deg_per_rad;
}

Json rows_json(const Eigen::Isometry3d& T) {
  Json numbers = Json::array();
  for (int row = 0; row < 3; ++row)
    for (int column = 0; column < 4; ++column) numbers.push_back(T.matrix()(row, column));
  return numbers;
}

Json pose_json(const Eigen::Isometry3d& T) {
  const Eigen::Vector3d t = T.translation();
  const Eigen::Quaterniond q(T.rotation());
  return {{"position", {t.x(), t.y(), t.z()}}, {"orientation_xyzw", {q.x(), q.y(), q.z(), q.w()}}};
}

}  // namespace stillmap::cli
