#include "core/planning/path_monitor.hpp"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

namespace stillmap {
namespace {

std::string text_of(const PathConflict& conflict) {
  std::ostringstream text;
  text << "not free any more: " << name(conflict.reason) << " at (" << conflict.cell_centre_map.x()
       << ", " << conflict.cell_centre_map.y() << "), " << conflict.along_m << " m along";
  return text.str();
}

std::string text_of(TileId id, std::size_t count) {
  std::ostringstream text;
  text << "tile " << id.x << " " << id.y;
  if (count > 1) text << " and " << count - 1 << " more";
  text << " on the path changed";
  return text.str();
}

}  // namespace

PathMonitor::PathMonitor(const TraversabilityView& view, const PathPlan& plan)
    : path_map_(plan.path_map()),
      was_found_(plan.is_found()),
      map_id_(view.map_id),
      tiles_(view.tiles),
      on_path_(tiles_on_path(view)) {}

/// The tiles that the circumscribed circle touches at any pose.
PathMonitor::Tiles PathMonitor::tiles_on_path(const TraversabilityView& view) const {
  const double reach_m = view.profile.circumscribed_radius_m();
  std::set<TileId> touched;
  for (const PlanarPose& pose : path_map_) {
    const Eigen::Vector2d low = ((pose.position_map.array() - reach_m) / view.tile_size_m).floor();
    const Eigen::Vector2d high = ((pose.position_map.array() + reach_m) / view.tile_size_m).floor();
    for (auto x = static_cast<std::int32_t>(low.x()); x <= static_cast<std::int32_t>(high.x());
         ++x) {
      for (auto y = static_cast<std::int32_t>(low.y()); y <= static_cast<std::int32_t>(high.y());
           ++y) {
        touched.insert({x, y});
      }
    }
  }
  Tiles tiles;
  for (const auto& tile : view.tiles) {
    if (touched.contains(tile->id)) tiles[tile->id] = tile;
  }
  return tiles;
}

std::optional<ReplanReason> PathMonitor::update(const TraversabilityView& view) {
  const bool is_other_map = view.map_id != map_id_;
  if (!is_other_map && view.tiles == tiles_) return std::nullopt;
  const bool was_empty = tiles_.empty();
  map_id_ = view.map_id;
  tiles_ = view.tiles;
  if (was_empty) return ReplanReason{"the map was empty", std::nullopt};
  if (is_other_map) return ReplanReason{"another map began", std::nullopt};
  if (!was_found_) return ReplanReason{"there was no path, and the map changed", std::nullopt};
  Tiles now = tiles_on_path(view);
  std::vector<TileId> changed;
  for (const auto& [id, tile] : now) {
    const auto before = on_path_.find(id);
    if (before == on_path_.end() || before->second != tile) changed.push_back(id);
  }
  for (const auto& [id, tile] : on_path_) {
    if (!now.contains(id)) changed.push_back(id);
  }
  on_path_ = std::move(now);
  if (changed.empty()) return std::nullopt;
  const PathCheck check = check_long_path(view, path_map_);
  if (check.conflict) return ReplanReason{text_of(*check.conflict), check.conflict};
  return ReplanReason{text_of(changed.front(), changed.size()), std::nullopt};
}

}  // namespace stillmap
