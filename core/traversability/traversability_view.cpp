#include "core/traversability/traversability_view.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <sstream>

#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

std::int32_t floor_divide(std::int32_t a, std::int32_t b) {
  return a >= 0 ? a / b : -((-a + b - 1) / b);
}

const TraversabilityTile* find_tile(const TraversabilityView& view, TileId id) {
  const auto tile = std::ranges::lower_bound(view.tiles, id, {},
                                             [](const auto& candidate) { return candidate->id; });
  return tile != view.tiles.end() && (*tile)->id == id ? tile->get() : nullptr;
}

NearestTraversable refused(TraversabilityStatus status, const std::string& reason) {
  NearestTraversable answer;
  answer.status = status;
  answer.reason = reason;
  return answer;
}

/// From a position to the nearest point of a tile [m].
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

std::optional<CellIndex> TraversabilityView::cell_of(const Eigen::Vector2d& position_map) const {
  // Per coordinate: the maximum of NaN and a number may be the number.
  const bool is_near = (position_map.array().abs() <= VoxelGrid::max_coordinate_m).all();
  if (!is_near || !(cell_m > 0.0)) {
    return std::nullopt;
  }
  const Eigen::Vector2d cell = (position_map / cell_m).array().floor();
  return CellIndex{static_cast<std::int32_t>(cell.x()), static_cast<std::int32_t>(cell.y())};
}

Eigen::Vector2d TraversabilityView::centre_of(CellIndex cell) const {
  return cell_m * Eigen::Vector2d(cell.x + 0.5, cell.y + 0.5);
}

Eigen::AlignedBox2d TraversabilityView::bounds_map() const {
  Eigen::AlignedBox2d box;
  for (const auto& tile : tiles) {
    const Eigen::Vector2d corner = tile_size_m * Eigen::Vector2d(tile->id.x, tile->id.y);
    box.extend(corner);
    box.extend(corner + Eigen::Vector2d::Constant(tile_size_m));
  }
  return box;
}

CellLookup::CellLookup(const TraversabilityView& view)
    : view_(view), side_(view.tiles.empty() ? 1 : view.tiles.front()->side) {}

CellLookup::Found CellLookup::at(CellIndex cell) {
  const TileId id{floor_divide(cell.x, side_), floor_divide(cell.y, side_)};
  if (id != last_id_) {
    last_ = find_tile(view_, id);
    last_id_ = id;
  }
  if (last_ == nullptr) return {};
  const int x = cell.x - id.x * side_;
  const int y = cell.y - id.y * side_;
  return {last_->at(x, y), last_->surface->at(x, y).cell};
}

void visit_footprint(const TraversabilityView& view, const PlanarPose& pose,
                     const std::function<void(CellIndex)>& visit) {
  const RobotProfile& profile = view.profile;
  const Eigen::Vector2d ahead(std::cos(pose.heading_rad), std::sin(pose.heading_rad));
  const Eigen::Vector2d left(-ahead.y(), ahead.x());
  const Eigen::Vector2d centre_map = pose.position_map + profile.centre_ahead_m * ahead;
  const double half_length_m = 0.5 * (profile.length_m + view.cell_m);
  const double half_width_m = 0.5 * (profile.width_m + view.cell_m);
  const Eigen::Vector2d reach_m = half_length_m * ahead.cwiseAbs() + half_width_m * left.cwiseAbs();
  const Eigen::Vector2d low = ((centre_map - reach_m) / view.cell_m).array().floor();
  const Eigen::Vector2d high = ((centre_map + reach_m) / view.cell_m).array().floor();
  for (auto y = static_cast<std::int32_t>(low.y()); y <= static_cast<std::int32_t>(high.y()); ++y) {
    for (auto x = static_cast<std::int32_t>(low.x()); x <= static_cast<std::int32_t>(high.x());
         ++x) {
      const Eigen::Vector2d offset_m = view.centre_of({x, y}) - centre_map;
      if (std::abs(offset_m.dot(ahead)) <= half_length_m &&
          std::abs(offset_m.dot(left)) <= half_width_m) {
        visit({x, y});
      }
    }
  }
}

std::string_view name(TraversabilityStatus status) {
  constexpr std::array<std::string_view, 4> names{"ok", "invalid request", "too large",
                                                  "not found"};
  return names.at(static_cast<std::size_t>(status));
}

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
  const double unreached_m = best.distance_m;
  for (const auto& tile : view.tiles) {
    if (distance_to(view, *tile, position_map) < best.distance_m) {
      search_tile(view, *tile, position_map, best);
    }
  }
  if (best.distance_m < unreached_m) return best;
  text << "no free cell for '" << view.profile.name << "' within " << max_distance_m << " m of ("
       << position_map.x() << ", " << position_map.y() << ")";
  return refused(TraversabilityStatus::not_found, text.str());
}

}  // namespace stillmap
