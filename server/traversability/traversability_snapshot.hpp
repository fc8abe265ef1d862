#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "core/map/query/tile_reader.hpp"
#include "core/traversability/traversability_view.hpp"
#include "server/publishers/latest_map.hpp"

namespace stillmap::server {

/// The traversability of all robots as of the last update, as immutable views: readers never wait
/// for an update. Thread-safe.
class TraversabilitySnapshot {
 public:
  /// One view a robot.
  using Views = std::vector<std::shared_ptr<const TraversabilityView>>;

  void publish(Views views);

  /// Throws std::invalid_argument for an unknown robot, naming the known ones.
  [[nodiscard]] std::shared_ptr<const TraversabilityView> view(const std::string& profile) const;

 private:
  mutable std::mutex mutex_;
  Views views_;
};

/// The traversability of any part of the map: the view that is kept up to date in the background,
/// or, where tiles of the map are not in memory, one that is computed for the query. Thread-safe.
class TraversabilityCache {
 public:
  TraversabilityCache(const TraversabilitySnapshot& snapshot, const LatestMap& latest_map,
                      TileReader& tiles);

  /// A view that is complete within the box (map frame [m]). Throws std::invalid_argument for an
  /// unknown robot, naming the known ones, and for a box with more non-resident tiles than one
  /// answer may read; and as TileReader::read.
  [[nodiscard]] std::shared_ptr<const TraversabilityView> view(
      const std::string& profile, const Eigen::AlignedBox2d& box_map) const;

 private:
  const TraversabilitySnapshot& snapshot_;
  const LatestMap& latest_map_;
  TileReader& tiles_;
};

}  // namespace stillmap::server
