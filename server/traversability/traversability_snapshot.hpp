#pragma once

#include <Eigen/Geometry>
#include <chrono>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/map/query/tile_reader.hpp"
#include "core/map/voxel_grid.hpp"
#include "core/traversability/traversability_view.hpp"
#include "server/publishers/latest_map.hpp"

namespace stillmap::server {

/// When a view of the map was published.
using MapTime = std::chrono::steady_clock::time_point;

/// What of the map the traversability is of.
struct MapInWindow {
  /// Of whose tiles: those that are in memory, and in the window. Null before the first.
  std::shared_ptr<const MapSnapshot> map;
  TileRange window;
  /// LatestMap's, and its newest pose's, read before the map.
  std::uint64_t corrections = 0;
  std::int64_t stamp_ns = 0;
  /// When the map was published; nothing where it is not known.
  std::optional<MapTime> map_time = std::nullopt;
};

/// The traversability of all robots as of the last update, as immutable views: readers never wait
/// for an update. Thread-safe.
class TraversabilitySnapshot {
 public:
  /// One view a robot.
  using Views = std::vector<std::shared_ptr<const TraversabilityView>>;

  void publish(Views views, MapInWindow of);

  /// A view, and what of the map it knows.
  struct Known : MapInWindow {
    std::shared_ptr<const TraversabilityView> view;

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
  MapInWindow of_;
};

/// The traversability of any part of the map: the view that is kept up to date in the background,
/// or, where it does not reach, tiles of the map are not in memory, or it has fallen behind on a
/// busy machine, one that is computed for the query. Thread-safe.
class TraversabilityCache {
 public:
  /// `longest_lag`: how much older than the map the view in the background may be where the map
  /// has changed since.
  TraversabilityCache(const TraversabilitySnapshot& snapshot, const LatestMap& latest_map,
                      TileReader& tiles,
                      std::chrono::milliseconds longest_lag = std::chrono::seconds(2));

  /// How old the view in the background may grow that is updated once in this period, and is no
  /// sign of a busy machine.
  [[nodiscard]] static std::chrono::milliseconds longest_lag(
      std::chrono::duration<double> update_period);

  /// A view that is complete within the boxes (map frame [m]); of more tiles than are computed for
  /// one answer it may be older than `longest_lag`. Throws std::invalid_argument for an
  /// unknown robot, naming the known ones, and for boxes with more such tiles that the view in the
  /// background has not; and as TileReader::read.
  [[nodiscard]] std::shared_ptr<const TraversabilityView> view(
      const std::string& profile, std::span<const Eigen::AlignedBox2d> boxes_map) const;
  [[nodiscard]] std::shared_ptr<const TraversabilityView> view(
      const std::string& profile, const Eigen::AlignedBox2d& box_map) const {
    return view(profile, std::span(&box_map, 1));
  }

 private:
  /// Whether the view in the background lacks what the map, published at `map_time`, has in the
  /// boxes for long.
  [[nodiscard]] bool is_behind(const TraversabilitySnapshot::Known& kept, MapTime map_time,
                               std::span<const std::shared_ptr<const Tile>> tiles,
                               std::span<const Eigen::AlignedBox2d> boxes_map) const;

  /// The last view that was computed for a query: clients ask for the same again and again.
  struct Computed {
    std::uint64_t map_id = 0;
    /// That it is of, as the map has them. Those that the map drops meanwhile are not kept for it.
    std::vector<std::weak_ptr<const Tile>> tiles;
    std::shared_ptr<const TraversabilityView> view;

    [[nodiscard]] bool is_of(const std::string& profile, std::uint64_t id,
                             std::span<const std::shared_ptr<const Tile>> others) const;
  };

  const TraversabilitySnapshot& snapshot_;
  const LatestMap& latest_map_;
  TileReader& tiles_;
  std::chrono::milliseconds longest_lag_;
  mutable std::mutex mutex_;
  /// Guarded by the mutex.
  mutable Computed computed_;
};

}  // namespace stillmap::server
