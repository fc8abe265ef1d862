#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "core/map/query/tile_reader.hpp"
#include "core/map/voxel_grid.hpp"
#include "core/traversability/traversability_view.hpp"
#include "server/publishers/latest_map.hpp"

namespace stillmap::server {

/// The traversability of all robots as of the last update, as immutable views: readers never wait
/// for an update. Thread-safe.
class TraversabilitySnapshot {
 public:
  /// One view a robot.
  using Views = std::vector<std::shared_ptr<const TraversabilityView>>;

  /// `map`: that they were computed from, where its tiles are in memory and in the window; null
  /// before the first. `corrections` and `stamp_ns`, that of its newest pose: LatestMap's, read
  /// before the map.
  void publish(Views views, std::shared_ptr<const MapSnapshot> map, const TileRange& window,
               std::uint64_t corrections = 0, std::int64_t stamp_ns = 0);

  /// A view, and what of the map it knows.
  struct Known {
    std::shared_ptr<const TraversabilityView> view;
    std::shared_ptr<const MapSnapshot> map;
    TileRange window;
    std::uint64_t corrections = 0;
    std::int64_t stamp_ns = 0;

    /// Whether the view has the tile's surface: one that was read from the disk since is not in it,
    /// one that is new will be.
    [[nodiscard]] bool has(const Tile& tile) const;
  };
  /// Throws std::invalid_argument for an unknown robot, naming the known ones.
  [[nodiscard]] Known known(const std::string& profile) const;
  [[nodiscard]] std::shared_ptr<const TraversabilityView> view(const std::string& profile) const {
    return known(profile).view;
  }

 private:
  mutable std::mutex mutex_;
  Views views_;
  std::shared_ptr<const MapSnapshot> map_;
  TileRange window_;
  std::uint64_t corrections_ = 0;
  std::int64_t stamp_ns_ = 0;
};

/// The traversability of any part of the map: the view that is kept up to date in the background,
/// or, where it does not reach or tiles of the map are not in memory, one that is computed for the
/// query. Thread-safe.
class TraversabilityCache {
 public:
  TraversabilityCache(const TraversabilitySnapshot& snapshot, const LatestMap& latest_map,
                      TileReader& tiles);

  /// A view that is complete within the boxes (map frame [m]). Throws std::invalid_argument for an
  /// unknown robot, naming the known ones, and for boxes with more tiles than are computed for
  /// one answer; and as TileReader::read.
  [[nodiscard]] std::shared_ptr<const TraversabilityView> view(
      const std::string& profile, std::span<const Eigen::AlignedBox2d> boxes_map) const;
  [[nodiscard]] std::shared_ptr<const TraversabilityView> view(
      const std::string& profile, const Eigen::AlignedBox2d& box_map) const {
    return view(profile, std::span(&box_map, 1));
  }

 private:
  const TraversabilitySnapshot& snapshot_;
  const LatestMap& latest_map_;
  TileReader& tiles_;
};

}  // namespace stillmap::server
