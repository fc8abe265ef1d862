#include "core/geodesy/earth_alignment.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/lidar/ranked_value.hpp"

namespace stillmap {
namespace {

struct Fit {
  Eigen::Isometry3d T_enu_map = Eigen::Isometry3d::Identity();
  /// Root of the weighted mean of the squared distances from the middle, on the ground [m].
  double spread_m = 0.0;
  double heading_sigma_rad = 0.0;
};

/// Closed form of the weighted problem in the plane; the height by itself.
Fit fit(std::span<const PointOnEarth> points, const std::vector<double>& weights) {
  Eigen::Vector3d middle_map = Eigen::Vector3d::Zero(), middle_enu = Eigen::Vector3d::Zero();
  double sum = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    middle_map += weights[i] * points[i].position_map;
    middle_enu += weights[i] * points[i].position_enu;
    sum += weights[i];
  }
  middle_map /= sum;
  middle_enu /= sum;
  double along = 0.0, across = 0.0, squared = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const Eigen::Vector2d a = (points[i].position_map - middle_map).head<2>();
    const Eigen::Vector2d b = (points[i].position_enu - middle_enu).head<2>();
    along += weights[i] * a.dot(b);
    across += weights[i] * (a.x() * b.y() - a.y() * b.x());
    squared += weights[i] * a.squaredNorm();
  }
  const Eigen::AngleAxisd heading(std::atan2(across, along), Eigen::Vector3d::UnitZ());
  Fit fit;
  fit.T_enu_map = Eigen::Translation3d(middle_enu - heading * middle_map) * heading;
  fit.spread_m = std::sqrt(squared / sum);
  fit.heading_sigma_rad = 1.0 / std::sqrt(squared);
  return fit;
}

double squared_sigmas(const PointOnEarth& point, const Eigen::Isometry3d& T_enu_map) {
  return (T_enu_map * point.position_map - point.position_enu).head<2>().squaredNorm() /
         (point.sigma_m * point.sigma_m);
}

double median_sigma_m(std::span<const PointOnEarth> points) {
  std::vector<double> sigmas;
  for (const PointOnEarth& point : points) sigmas.push_back(point.sigma_m);
  return median_of(sigmas);
}

}  // namespace

std::optional<Eigen::Isometry3d> align_to_earth(std::span<const PointOnEarth> points,
                                                const EarthAlignmentConfig& config) {
  constexpr int iterations = 20;
  constexpr double kernel_sigmas = 2.0;
  if (points.size() < std::max<std::size_t>(config.min_points, 2)) return std::nullopt;
  std::vector<double> weights;
  for (const PointOnEarth& point : points) weights.push_back(1.0 / (point.sigma_m * point.sigma_m));
  Fit found = fit(points, weights);
  for (int k = 0; k < iterations; ++k) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      const double squared = squared_sigmas(points[i], found.T_enu_map);
      weights[i] = 1.0 / (points[i].sigma_m * points[i].sigma_m) /
                   (1.0 + squared / (kernel_sigmas * kernel_sigmas));
    }
    found = fit(points, weights);
  }
  const bool is_known = found.heading_sigma_rad <= config.max_heading_sigma_rad &&
                        found.spread_m >= config.min_spread_sigmas * median_sigma_m(points);
  if (!is_known) return std::nullopt;
  return found.T_enu_map;
}

}  // namespace stillmap
