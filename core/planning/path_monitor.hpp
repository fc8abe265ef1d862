#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/planning/path_planner.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// Why a path should be replanned.
struct ReplanReason {
  std::string reason;
  /// The conflict; nothing if the path is still free and only its tiles changed.
  std::optional<PathConflict> conflict;
};

/// Keeps a path with the tiles that it was planned on and detects when a newer snapshot of the map
/// requires replanning.
class PathMonitor {
 public:
  PathMonitor(const TraversabilityView& view, const PathPlan& plan);

  /// A reason if the path has a conflict or a tile along it was added, removed or changed; nothing
  /// if the path is still valid. The next call compares with this view.
  [[nodiscard]] std::optional<ReplanReason> update(const TraversabilityView& view);

 private:
  using Tiles = std::map<TileId, std::shared_ptr<const TraversabilityTile>>;

  [[nodiscard]] Tiles tiles_on_path(const TraversabilityView& view) const;

  std::vector<PlanarPose> path_map_;
  bool was_found_;
  std::uint64_t map_id_;
  /// Of the last view. Equal pointers mean equal cells.
  std::vector<std::shared_ptr<const TraversabilityTile>> tiles_;
  Tiles on_path_;
};

}  // namespace stillmap
