#include "core/traversability/nearest_traversable.hpp"

#include <cmath>
#include <sstream>

namespace stillmap {
namespace {

NearestTraversable refused(TraversabilityStatus status, const std::string& reason) {
  NearestTraversable answer;
  answer.status = status;
  answer.reason = reason;
  return answer;
}

/// From a place to a tile [m].
double distance_to(const TraversabilityView& view, const TraversabilityTile& tile,
                   const Eigen::Vector2d& position_map) {
  const Eigen::Vector2d low = view.tile_size_m * Eigen::Vector2d(tile.id.x, tile.id.y);
  const Eigen::AlignedBox2d box(low, low + Eigen::Vector2d::Constant(view.tile_size_m));
  return box.exteriorDistance(position_map);
}

void search_tile(const TraversabilityView& view, const TraversabilityTile& tile,
                 const Eigen::Vector2d& position_map, NearestTraversable& best) {
  for (int y = 0; y < tile.side; ++y) {
    for (int x = 0; x < tile.side; ++x) {
      const TraversabilityCell& cell = tile.at(x, y);
      if (cell.state != CellState::free) continue;
      const Eigen::Vector2d centre_map =
          view.centre_of({tile.id.x * tile.side + x, tile.id.y * tile.side + y});
      const double distance_m = (centre_map - position_map).norm();
      if (distance_m >= best.distance_m) continue;
      best.distance_m = distance_m;
      best.position_map = centre_map;
      best.height_m = tile.surface->at(x, y).cell->ground.height_m;
      best.cell = cell;
    }
  }
}

}  // namespace

NearestTraversable nearest_traversable(const TraversabilityView& view,
                                       const Eigen::Vector2d& position_map, double max_distance_m) {
  if (view.tiles.empty()) return refused(TraversabilityStatus::not_found, "the map is empty");
  std::ostringstream text;
  if (!view.cell_of(position_map)) {
    text << "position (" << position_map.x() << ", " << position_map.y()
         << "); must be finite and within 100 km of the map's origin";
    return refused(TraversabilityStatus::invalid_request, text.str());
  }
  if (!(max_distance_m > 0.0)) {
    text << "max_distance_m = " << max_distance_m << "; must be above 0";
    return refused(TraversabilityStatus::invalid_request, text.str());
  }
  NearestTraversable best;
  best.map_version = view.version;
  best.distance_m = std::nextafter(max_distance_m, HUGE_VAL);
  const double beyond_m = best.distance_m;
  for (const auto& tile : view.tiles) {
    if (distance_to(view, *tile, position_map) < best.distance_m) {
      search_tile(view, *tile, position_map, best);
    }
  }
  if (best.distance_m < beyond_m) return best;
  text << "no free cell for '" << view.profile.name << "' within " << max_distance_m << " m of ("
       << position_map.x() << ", " << position_map.y() << ")";
  return refused(TraversabilityStatus::not_found, text.str());
}

}  // namespace stillmap
