#include "core/map/tools/class_lookup.hpp"

#include <tsl/robin_map.h>

#include <Eigen/Core>
#include <cmath>
#include <utility>

#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

/// Column, row and layer of the whole map.
using Cell = Eigen::Matrix<std::int64_t, 3, 1>;

std::uint64_t key_of(const Cell& cell) {
  // No map spans 2^21 voxels: at the finest in use, 5 cm, that were 100 km.
  constexpr std::uint64_t mask = (1U << 21) - 1;
  const auto bits = cell.cast<std::uint64_t>();
  return (bits.x() & mask) << 42 | (bits.y() & mask) << 21 | (bits.z() & mask);
}

struct Fibonacci {
  std::size_t operator()(std::uint64_t key) const {
    const std::uint64_t spread = key * 0x9E3779B97F4A7C15ULL;
    return spread ^ spread >> 32;
  }
};

}  // namespace

struct ClassLookup::Cells {
  [[nodiscard]] Cell cell(TileId tile, VoxelIndex index) const {
    return {tile.x * columns + index.x, tile.y * columns + index.y, index.z};
  }
  [[nodiscard]] std::optional<SemanticClass> at(const Cell& cell) const {
    const auto found = class_of.find(key_of(cell));
    return found == class_of.end() ? std::nullopt : std::optional(found->second);
  }
  [[nodiscard]] NearClasses search(const Cell& centre, SemanticClass label, int reach) const;

  /// Voxels along a tile's side.
  std::int64_t columns = 1;
  tsl::robin_map<std::uint64_t, SemanticClass, Fibonacci> class_of;
};

NearClasses ClassLookup::Cells::search(const Cell& centre, SemanticClass label, int reach) const {
  NearClasses near;
  std::int64_t nearest_squared = 0;
  for (int x = -reach; x <= reach; ++x) {
    for (int y = -reach; y <= reach; ++y) {
      for (int z = -reach; z <= reach; ++z) {
        const auto found = at(centre + Cell(x, y, z));
        if (!found) continue;
        if (*found == label) return {.has_same = true, .nearest = std::nullopt};
        const std::int64_t squared = x * x + y * y + z * z;
        if (near.nearest && squared >= nearest_squared) continue;
        near.nearest = found;
        nearest_squared = squared;
      }
    }
  }
  return near;
}

ClassLookup::ClassLookup(const MapSnapshot& view, const MapSnapshot& asking) {
  const MapSnapshot& filled = view.tiles.empty() ? asking : view;
  auto cells = std::make_unique<Cells>();
  if (!filled.tiles.empty())
    cells->columns = std::llround(filled.tile_size_m / filled.voxel_size_m);
  std::size_t voxels = 0;
  for (const auto& tile : view.tiles) voxels += tile->voxels.size();
  cells->class_of.reserve(voxels);
  for (const auto& tile : view.tiles) {
    for (const Voxel& voxel : tile->voxels) {
      cells->class_of[key_of(cells->cell(tile->info.id, voxel.index))] = voxel.evidence.winner();
    }
  }
  cells_ = std::move(cells);
}

ClassLookup::~ClassLookup() = default;

NearClasses ClassLookup::near(TileId tile, VoxelIndex index, SemanticClass label, int reach) const {
  const Cell centre = cells_->cell(tile, index);
  // Mostly, nothing changed.
  if (cells_->at(centre) == label) return {.has_same = true, .nearest = std::nullopt};
  return cells_->search(centre, label, reach);
}

}  // namespace stillmap
