#pragma once

#include <Eigen/Geometry>
#include <span>
#include <vector>

namespace stillmap {

/// Where a scan may have been taken, by E. Olson's correlative scan matching ("Real-Time
/// Correlative Scan Matching", ICRA 2009) over x, y and heading: every pose of a grid is judged by
/// how many of the scan's landmarks fall into cells that landmarks of the map occupy. Needs no
/// start that registration would converge from.
struct CorrelativeSearchConfig {
  /// Poses up to this far from the guess along x and y, at any heading [m].
  double reach_m = 24.0;
  /// Edge of a cell, and step between the poses [m].
  double cell_m = 1.0;
  double heading_step_rad = 0.05;
  /// Landmarks farther from the lidar than this are not used [m].
  double max_range_m = 40.0;
  /// So many landmarks of the scan are enough.
  std::size_t max_landmarks = 400;
  /// Candidates are at least this far apart, or turned [m, rad].
  double spacing_m = 2.5;
  double spacing_rad = 0.15;
};

/// The best poses, the best first, at most `count`. Height, roll and pitch are those of the guess.
[[nodiscard]] std::vector<Eigen::Isometry3d> correlative_search(
    std::span<const Eigen::Vector3f> landmarks_lidar,
    std::span<const Eigen::Vector3f> landmarks_map, const Eigen::Isometry3d& T_map_lidar_guess,
    std::size_t count, const CorrelativeSearchConfig& config = {});

}  // namespace stillmap
