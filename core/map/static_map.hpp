#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <span>

#include "core/lidar/labelled_scan.hpp"
#include "core/map/tile.hpp"

namespace stillmap {

struct StaticMapConfig {
  double voxel_size_m = 0.2;
  /// A whole number of voxels, at most 256.
  double tile_size_m = 20.0;
  /// Points farther from the lidar than this are not mapped.
  double max_range_m = 60.0;
  /// A voxel enters the view once it was hit this often.
  std::uint32_t min_points = 2;

  /// Every fault in words, one a line; empty when the configuration can be used.
  [[nodiscard]] std::string faults() const;
};

/// The planning map: stationary points only, as labelled voxels in tiles (paper II-C.2). One
/// thread writes; views are immutable and may be read from any thread.
class StaticMap {
 public:
  /// Throws std::invalid_argument with `config.faults()`.
  explicit StaticMap(const StaticMapConfig& config);
  ~StaticMap();
  StaticMap(StaticMap&&) noexcept;
  StaticMap& operator=(StaticMap&&) noexcept;

  /// Adds the stationary points of the scan. Semi-static points add evidence to voxels that exist
  /// and make none; highly dynamic points are left out, as are points that are not finite, beyond
  /// `max_range_m`, or farther than 100 km from the map's origin. `scan.motion` is as long as the
  /// scan. The result does not depend on the number of threads.
  void insert(const LabelledScan& scan, const Eigen::Isometry3d& T_map_lidar);

  /// What a place (map frame [m]) was seen as so far, shown in a view or not; without votes where
  /// nothing was seen. Thread-safe beside itself.
  [[nodiscard]] ClassEvidence evidence_at(const Eigen::Vector3d& position_map) const;

  /// The planning view as it is now: voxels hit `min_points` times whose class is not a movable
  /// one. Tiles whose content (tile_content.hpp) did not change since the last view are shared
  /// with it, with their counts and times of then; where nothing changed, so is the whole view.
  [[nodiscard]] std::shared_ptr<const MapView> view();

  /// Takes over a stored view; later scans extend it. Give it a new `map_id`: the map may have
  /// been at a later version than the one stored. Throws std::invalid_argument when its voxel or
  /// tile size is not the configured one.
  void restore(const MapView& view);

  /// Empties the map; `map_id` tells clients that it is another one now.
  void reset(std::uint64_t map_id);

  [[nodiscard]] const StaticMapConfig& config() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stillmap
