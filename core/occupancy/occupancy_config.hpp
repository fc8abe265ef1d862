#pragma once

#include <cstdint>
#include <string>

namespace stillmap {

/// Sensor model and resolution of an occupancy map. The probabilities are OctoMap's defaults
/// (Hornung et al., 2013).
struct OccupancyConfig {
  /// Edge of the smallest voxel. The map extends 32768 voxels from its origin in every direction.
  double resolution_m = 0.2;
  /// Of maps that are made here; files of other programs are read as they are.
  static constexpr double min_resolution_m = 0.02;
  static constexpr double max_resolution_m = 10.0;
  /// Points beyond this range do not mark voxels as occupied.
  double max_range_m = 60.0;
  /// Rays mark the voxels that they traverse as free up to this range; 0 disables clearing.
  double clearing_range_m = 25.0;
  /// One scan in this many clears: consecutive scans traverse nearly the same voxels.
  std::uint32_t clearing_interval = 3;
  /// Clearing ends this far, plus this share of the range, before the ray's point: near its end a
  /// ray grazes the surface that it hits.
  double clearing_margin_m = 0.5;
  double clearing_margin_share = 0.02;
  /// Inverse sensor model: occupancy probability given a hit, and given a ray that traverses the
  /// voxel.
  double hit_probability = 0.7;
  double miss_probability = 0.4;

  /// Clamping thresholds, so that a voxel can change its state within a few scans.
  static constexpr double min_probability = 0.1192;
  static constexpr double max_probability = 0.971;

  /// One line for each invalid value; empty when the configuration is valid.
  [[nodiscard]] std::string faults() const;
};

/// How one scan updates the occupancy map.
struct ScanUpdateOptions {
  /// Whether its rays may clear; they do in one scan of every `clearing_interval`.
  bool clear_free_space = true;
  /// Whether unlabelled points mark voxels as occupied; false where they may belong to moving
  /// objects.
  bool unknown_is_solid = true;
};

}  // namespace stillmap
