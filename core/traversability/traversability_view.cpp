#include "core/traversability/traversability_view.hpp"

#include <algorithm>
#include <cmath>

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

}  // namespace

std::optional<CellIndex> TraversabilityView::cell_of(const Eigen::Vector2d& position_map) const {
  // Each by itself: the largest of NaN and a number may be the number.
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

}  // namespace stillmap
