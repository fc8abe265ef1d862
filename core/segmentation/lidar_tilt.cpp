#include "core/segmentation/lidar_tilt.hpp"

#include <algorithm>
#include <cmath>

#include "core/lidar/angle_units.hpp"

namespace stillmap {

LidarTilt::LidarTilt(const Eigen::Matrix3d& R_base_lidar)
    : R_base_lidar_(R_base_lidar),
      tilt_rad_(std::acos(std::clamp(R_base_lidar(2, 2), -1.0, 1.0))) {}

std::vector<Eigen::Vector3f> LidarTilt::turned(
    std::span<const Eigen::Vector3f> points_lidar) const {
  const Eigen::Matrix3f R_base_lidar = R_base_lidar_.cast<float>();
  std::vector<Eigen::Vector3f> points;
  points.reserve(points_lidar.size());
  for (const Eigen::Vector3f& point : points_lidar) points.emplace_back(R_base_lidar * point);
  return points;
}

bool LidarTilt::turns_image() const {
  // At 7 degrees both kinds find as much, at 15 the turned ones more.
  constexpr double max_tilt_of_own_image = 8.0 * rad_per_deg;
  return tilt_rad_ > max_tilt_of_own_image;
}

ProjectionModel LidarTilt::widened(ProjectionModel upright) const {
  if (!turns_image()) return upright;
  double highest = -1.0, lowest = 1.0;
  for (const double elevation : {upright.fov_up, upright.fov_down}) {
    for (int azimuth = 0; azimuth < 360; ++azimuth) {
      const double a = azimuth * rad_per_deg;
      const double up = R_base_lidar_.row(2).dot(
          Eigen::RowVector3d(std::cos(elevation) * std::cos(a), std::cos(elevation) * std::sin(a),
                             std::sin(elevation)));
      highest = std::max(highest, up);
      lowest = std::min(lowest, up);
    }
  }
  // Straight up or down may lie within the field of view, not on its edges.
  const double pole = std::asin(std::clamp(R_base_lidar_(2, 2), -1.0, 1.0));
  if (pole >= upright.fov_down && pole <= upright.fov_up) highest = 1.0;
  if (-pole >= upright.fov_down && -pole <= upright.fov_up) lowest = -1.0;
  upright.fov_up = std::asin(std::clamp(highest, -1.0, 1.0));
  upright.fov_down = std::asin(std::clamp(lowest, -1.0, 1.0));
  return upright;
}

}  // namespace stillmap
