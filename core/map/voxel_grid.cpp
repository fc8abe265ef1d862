#include "core/map/voxel_grid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/map/tile.hpp"

namespace stillmap {
namespace {

/// Of a float at 100 km.
constexpr double float_step_m = 0.01;

struct IdRange {
  std::int32_t first;
  std::int32_t last;
};

std::int32_t clamped_id(double id) {
  constexpr double lowest = std::numeric_limits<std::int32_t>::min() + 1.0;
  constexpr double highest = std::numeric_limits<std::int32_t>::max() - 1.0;
  return static_cast<std::int32_t>(std::clamp(std::floor(id), lowest, highest));
}

/// Tiles that [min, max] may touch, one more on either side: a mean in float may lie just outside
/// its tile. The tiles' bounds decide.
IdRange ids_between(double min_m, double max_m, double tile_size_m) {
  return {clamped_id(min_m / tile_size_m) - 1, clamped_id(max_m / tile_size_m) + 1};
}

bool is_usable(const Eigen::AlignedBox3d& box) {
  return (box.min().array() <= box.max().array()).all();  // false for NaN
}

}  // namespace

Eigen::Vector3d VoxelGrid::corner_map(TileId tile, VoxelIndex voxel) const {
  return voxel_size_m_ * Eigen::Vector3d(static_cast<double>(tile.x) * columns_ + voxel.x,
                                         static_cast<double>(tile.y) * columns_ + voxel.y, voxel.z);
}

TileRange tile_range(const Eigen::AlignedBox3d& box_map, double tile_size_m) {
  const auto id = [&](double m) { return clamped_id(m / tile_size_m); };
  const Eigen::Vector3d& low = box_map.min();
  const Eigen::Vector3d& high = box_map.max();
  return {.first = {id(low.x() - float_step_m), id(low.y() - float_step_m)},
          .last = {id(high.x() + float_step_m), id(high.y() + float_step_m)}};
}

Eigen::AlignedBox3d tile_footprint(TileId id, double tile_size_m) {
  constexpr double everywhere = std::numeric_limits<double>::infinity();
  const Eigen::Vector2d corner(id.x * tile_size_m, id.y * tile_size_m);
  return {Eigen::Vector3d(corner.x() - float_step_m, corner.y() - float_step_m, -everywhere),
          Eigen::Vector3d(corner.x() + tile_size_m + float_step_m,
                          corner.y() + tile_size_m + float_step_m, everywhere)};
}

std::vector<std::shared_ptr<const Tile>> tiles_in_range(const TileTable& tiles,
                                                        const TileRange& range,
                                                        std::size_t max_tiles, TileId from) {
  std::vector<std::shared_ptr<const Tile>> found;
  auto tile = tiles.lower_bound(std::max(range.first, from));
  while (tile != tiles.end() && (*tile)->info.id.x <= range.last.x && found.size() < max_tiles) {
    const TileId id = (*tile)->info.id;
    if (id.y < range.first.y || id.y > range.last.y) {
      // On to where the range begins in this row of tiles or in the next one.
      tile = tiles.lower_bound({id.y < range.first.y ? id.x : id.x + 1, range.first.y});
    } else {
      found.push_back(*tile);
      ++tile;
    }
  }
  return found;
}

std::vector<std::shared_ptr<const Tile>> tiles_in_box(const MapSnapshot& view,
                                                      const Eigen::AlignedBox3d& box_map) {
  if (view.tiles.empty() || !is_usable(box_map)) return {};
  const IdRange xs = ids_between(box_map.min().x(), box_map.max().x(), view.tile_size_m);
  const IdRange ys = ids_between(box_map.min().y(), box_map.max().y(), view.tile_size_m);
  auto found = tiles_in_range(view.tiles, {{xs.first, ys.first}, {xs.last, ys.last}});
  std::erase_if(found, [&](const auto& tile) {
    return !box_map.intersects(tile->info.bounds_map.template cast<double>());
  });
  return found;
}

}  // namespace stillmap
