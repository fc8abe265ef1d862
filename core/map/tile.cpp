#include "core/map/tile.hpp"

#include <xxhash.h>

#include <algorithm>
#include <array>
#include <utility>

namespace stillmap {
std::string_view name(RemovalReason reason) {
  constexpr std::array<std::string_view, removal_reason_count> names{"moving", "semi-static",
                                                                     "seen through", "relabelled"};
  return names.at(static_cast<std::size_t>(reason));
}

std::uint64_t content_hash(std::span<const PackedVoxel> voxels) {
  std::vector<std::uint64_t> words(voxels.size());
  std::ranges::transform(voxels, words.begin(), content_word);
  return XXH3_64bits(words.data(), words.size() * sizeof(words[0]));
}

Tile make_tile(TileId id, std::uint64_t revision, PackedVoxels voxels) {
  Tile tile;
  tile.info.id = id;
  tile.info.revision = revision;
  tile.info.content_hash = content_hash(voxels.packed());
  tile.info.voxel_count = static_cast<std::uint32_t>(voxels.size());
  tile.info.bounds_map = voxels.bounds_map();
  tile.voxels = std::move(voxels);
  return tile;
}

Tile make_tile(TileId id, std::uint64_t revision, std::span<const Voxel> voxels,
               const VoxelGrid& grid) {
  return make_tile(id, revision, PackedVoxels(id, grid, voxels));
}

std::shared_ptr<const Tile> find_tile(const MapSnapshot& view, TileId id) {
  return view.tiles.find(id);
}

}  // namespace stillmap
