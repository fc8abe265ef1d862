#pragma once

#include <Eigen/Geometry>
#include <optional>
#include <span>

namespace stillmap {

/// A point that is known in the map and on the earth.
struct PointOnEarth {
  Eigen::Vector3d position_map = Eigen::Vector3d::Zero();
  Eigen::Vector3d position_enu = Eigen::Vector3d::Zero();
  /// Standard deviation of position_enu, east and north [m].
  double sigma_m = 1.0;
};

struct EarthAlignmentConfig {
  std::size_t min_points = 6;
  /// How well the map's heading must be known [rad].
  double max_heading_sigma_rad = 0.03;
  /// Errors of neighbouring fixes are the same: the way must be longer than they are by this.
  double min_spread_sigmas = 10.0;
};

/// Where a level map lies: rotation about the vertical and translation. Least squares, reweighted
/// by Cauchy's kernel of two standard deviations, since reflected signals lead astray by tens of
/// metres. Nothing while the points say too little, as those of a robot that stands.
[[nodiscard]] std::optional<Eigen::Isometry3d> align_to_earth(
    std::span<const PointOnEarth> points, const EarthAlignmentConfig& config = {});

}  // namespace stillmap
