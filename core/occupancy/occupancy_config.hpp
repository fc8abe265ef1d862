#pragma once

#include <cstdint>
#include <string>

namespace stillmap {

/// How an occupancy map grows. The probabilities are OctoMap's own defaults (Hornung et al., 2013).
struct OccupancyConfig {
  /// Edge of the smallest voxel. The map reaches 32768 of them from its origin, to every side.
  double resolution_m = 0.2;
  /// Points farther from the lidar make no occupied voxels.
  double max_range_m = 60.0;
  /// Rays clear what they pass up to this range; 0: nothing is ever cleared.
  double clear_range_m = 25.0;
  /// Every so many scans one clears: all of them would tell the same.
  std::uint32_t clearing_interval = 3;
  /// A ray clears up to this much, and this share of its range, before its point: near its end a
  /// ray grazes the surface that it hits.
  double clear_margin_m = 0.5;
  double clear_margin_share = 0.02;
  /// What one scan tells of a voxel that it hit, and of one that its rays passed.
  double hit_probability = 0.7;
  double miss_probability = 0.4;

  /// A voxel is never surer than this, so that it can change its mind.
  static constexpr double min_probability = 0.1192;
  static constexpr double max_probability = 0.971;

  /// Every fault in words, one a line; empty when the configuration can be used.
  [[nodiscard]] std::string faults() const;
};

/// What of a scan counts for the occupancy map.
struct ScanUpdateOptions {
  /// Its rays clear what they pass, if it is one of those that do.
  bool clear_free_space = true;
  /// Points of no known class are solid; false where they may be movers that came into sight.
  bool unknown_is_solid = true;
};

}  // namespace stillmap
