#include "core/map/tile_content.hpp"

#include <xxhash.h>

#include <algorithm>
#include <utility>

namespace stillmap {
namespace {

/// A voxel's content in one word: 48 bits of index, three times 3 bits of mean, 5 bits of class.
std::uint64_t content_word(TileId tile, const Voxel& voxel, const VoxelGrid& grid) {
  constexpr int steps = 8;
  const Eigen::Vector3d offset =
      (voxel.mean_map.cast<double>() - grid.corner_map(tile, voxel.index)) / grid.voxel_size_m();
  const Eigen::Vector3i step =
      (offset * steps).array().floor().cwiseMax(0.0).cwiseMin(steps - 1.0).cast<int>();
  const auto mean = static_cast<std::uint64_t>((step.x() * steps + step.y()) * steps + step.z());
  return std::uint64_t{voxel.index.x} << 48 | std::uint64_t{voxel.index.y} << 32 |
         std::uint64_t{static_cast<std::uint16_t>(voxel.index.z)} << 16 | mean << 5 |
         static_cast<std::uint64_t>(voxel.evidence.winner());
}

}  // namespace

std::uint64_t content_hash(TileId tile, std::span<const Voxel> voxels, const VoxelGrid& grid) {
  std::vector<std::uint64_t> words(voxels.size());
  std::ranges::transform(voxels, words.begin(),
                         [&](const Voxel& voxel) { return content_word(tile, voxel, grid); });
  return XXH3_64bits(words.data(), words.size() * sizeof(words[0]));
}

Tile make_tile(TileId id, std::uint64_t revision, std::vector<Voxel> voxels,
               const VoxelGrid& grid) {
  Tile tile;
  tile.info.id = id;
  tile.info.revision = revision;
  tile.info.content_hash = content_hash(id, voxels, grid);
  tile.info.voxel_count = static_cast<std::uint32_t>(voxels.size());
  for (const Voxel& voxel : voxels) tile.info.bounds_map.extend(voxel.mean_map);
  tile.voxels = std::move(voxels);
  return tile;
}

}  // namespace stillmap
