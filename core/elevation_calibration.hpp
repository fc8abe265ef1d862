#pragma once

#include <cmath>
#include <cstddef>
#include <functional>
#include <optional>
#include <vector>

#include "core/mapper.hpp"

namespace stillmap {

struct ElevationCalibrationConfig {
  /// Offsets that are tried: up to this far either way, and so far apart [rad].
  double reach = 0.007;
  double step = 0.00175;
  [[nodiscard]] std::size_t trials() const {
    return 2 * static_cast<std::size_t>(std::lround(reach / step)) + 1;
  }
  /// Edge of the voxels that are counted [m], and how far from the lidar points count [m].
  double voxel_size_m = 0.2;
  double max_range_m = 60.0;
  /// An offset that is known worse than this is not known [rad].
  double max_sigma = 0.0009;
};

struct ElevationCalibration {
  struct Trial {
    /// [rad]
    double offset = 0.0;
    std::size_t voxels = 0;
  };
  /// In the order of their offsets.
  std::vector<Trial> trials;
  /// SensorModel::elevation_offset with which the scans lie best on one another, the lowest point
  /// of a parabola through the trials [rad]; nothing where they do not tell, as when the lidar
  /// stands.
  std::optional<double> offset;
  /// Its standard deviation [rad].
  double sigma = 0.0;
  /// Share of the voxels that it saves against none, by the parabola.
  double saving = 0.0;
};

/// Finds by how much a lidar's vertical angles are off from a drive of its own, without any truth:
/// an offset bends ground and walls as they are seen from farther away, so that scans of several
/// places thicken what they map, and the map has more occupied voxels. Drives once for every offset
/// that is tried: config.trials() times. `scan_at` gives scan 0 to `scans` - 1. Throws what it and
/// Mapper throw.
[[nodiscard]] ElevationCalibration calibrate_elevation(
    const MapperConfig& mapper, std::size_t scans, const std::function<Scan(std::size_t)>& scan_at,
    const ElevationCalibrationConfig& config = {});

}  // namespace stillmap
