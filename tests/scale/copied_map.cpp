// A large map that looks like a city: copies of a map's tiles, side by side.
//
//   copied_map FROM TO COPIES
//
// In rows of as many as make a square. The path stays that of the first copy.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <filesystem>
#include <memory>
#include <utility>
#include <vector>

#include "core/map/storage/map_file.hpp"
#include "core/map/storage/map_file_copy.hpp"

namespace stillmap::test {
namespace {

PackedVoxels elsewhere(const PackedVoxels& voxels, TileId id) {
  SeenTimes seen{{voxels.stamps_ns().begin(), voxels.stamps_ns().end()}, {}};
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    seen.stamp_of.push_back(voxels.first_stamp(i));
    seen.stamp_of.push_back(voxels.last_stamp(i));
  }
  return {id, voxels.grid(), {voxels.packed().begin(), voxels.packed().end()}, seen};
}

void copy(const std::filesystem::path& from, const std::filesystem::path& to, int copies) {
  SavedMap map = read_map_file(from);
  TileId low{};
  TileId high{};
  for (const auto& tile : map.view.tiles) {
    const TileId id = tile->info.id;
    low = {std::min(low.x, id.x), std::min(low.y, id.y)};
    high = {std::max(high.x, id.x), std::max(high.y, id.y)};
  }
  const int columns = static_cast<int>(std::ceil(std::sqrt(copies)));
  std::vector<std::shared_ptr<const Tile>> tiles;
  for (int copy = 0; copy < copies; ++copy) {
    const TileId by{(copy % columns) * (high.x - low.x + 1),
                    (copy / columns) * (high.y - low.y + 1)};
    for (const auto& tile : map.view.tiles) {
      const TileId id{tile->info.id.x + by.x, tile->info.id.y + by.y};
      tiles.push_back(std::make_shared<const Tile>(
          make_tile(id, tile->info.revision, elsewhere(tile->voxels, id))));
    }
  }
  map.view.tiles = TileTable(std::move(tiles));
  map.tile_evidence.clear();
  open_map_file(to)->save(map);
  std::printf("%llu voxels\n", static_cast<unsigned long long>(map.view.tiles.voxel_count()));
}

}  // namespace
}  // namespace stillmap::test

int main(int argc, char** argv) {
  const int copies = argc == 4 ? std::atoi(argv[3]) : 0;
  if (copies < 1) {
    std::fprintf(stderr, "usage: %s FROM TO COPIES\n", argv[0]);
    return 2;
  }
  try {
    stillmap::test::copy(argv[1], argv[2], copies);
  } catch (const std::exception& fault) {
    std::fprintf(stderr, "copied_map: %s\n", fault.what());
    return 1;
  }
}
