#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/planning/path_planner.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// Why a path should be planned anew.
struct ReplanReason {
  /// In words.
  std::string reason;
  /// Where the path is not free any more; nothing when only the way changed.
  std::optional<PathConflict> conflict;
};

/// Remembers a path and the tiles that it was planned on, and tells when a newer state of the map
/// asks for another one.
class PathMonitor {
 public:
  PathMonitor(const TraversabilityView& view, const PathPlan& plan);

  /// When the path is not free any more, or a tile under the robot's way appeared, went or has
  /// other cells than before; nothing when the path can stay. A later call compares with this view.
  [[nodiscard]] std::optional<ReplanReason> update(const TraversabilityView& view);

 private:
  using Tiles = std::map<TileId, std::shared_ptr<const TraversabilityTile>>;

  [[nodiscard]] Tiles tiles_on_path(const TraversabilityView& view) const;

  std::vector<PlanarPose> path_map_;
  bool was_found_;
  std::uint64_t map_id_;
  /// Of the last view: a tile that is the same object has the same cells.
  std::vector<std::shared_ptr<const TraversabilityTile>> tiles_;
  Tiles on_path_;
};

}  // namespace stillmap
