#include <algorithm>
#include <stdexcept>
#include <string>

#include "server/mapping/mapping_thread.hpp"

// What is kept out of the planning view, and comes back: requests to the mapping thread that take
// long in a large map, tile by tile between scans.

namespace stillmap::server {
namespace {

// Tiles that a request looks at before it lets a waiting scan pass; some milliseconds.
constexpr std::size_t tiles_at_once = 8;

// Tiles of one request that may have to be read from the disk.
constexpr std::size_t max_stored_tiles = 4000;

}  // namespace

RemovedInBox MappingThread::removed(const Eigen::AlignedBox3d& box_map) {
  const TilesOfBox tiles = tiles_of(box_map);
  StaticMap::RemovedVoxels all;
  for (std::span<const TileId> left(tiles.ids); !left.empty();) {
    run_on_some(tiles.map_id, left, [&](std::span<const TileId> some) {
      StaticMap::RemovedVoxels part = mapper_.static_map().removed(box_map, some);
      all.voxels.insert(all.voxels.end(), part.voxels.begin(), part.voxels.end());
      all.non_resident.insert(all.non_resident.end(), part.non_resident.begin(),
                              part.non_resident.end());
      return true;
    });
  }
  return {std::move(all.voxels), std::move(all.non_resident), tiles.tile_store};
}

std::size_t MappingThread::restore_removed(RemovalReason reason, const Eigen::AlignedBox3d& box_map,
                                           const std::function<void()>& make_room) {
  const TilesOfBox tiles = tiles_of(box_map);
  StaticMap::RestoredVoxels restored;
  for (std::span<const TileId> left(tiles.ids); !left.empty();) {
    bool is_full = false;
    run_on_some(tiles.map_id, left, [&](std::span<const TileId> some) {
      const auto part = mapper_.static_map().restore_removed(reason, box_map, some);
      restored.count += part.count;
      restored.unreadable.insert(restored.unreadable.end(), part.unreadable.begin(),
                                 part.unreadable.end());
      is_full = mapper_.static_map().memory_use().bytes > map_limit_bytes_;
      return !is_full;
    });
    if (is_full) make_room();
  }
  if (!restored.unreadable.empty()) {
    throw std::runtime_error(restored.unreadable_text());
  }
  return restored.count;
}

MappingThread::TilesOfBox MappingThread::tiles_of(const Eigen::AlignedBox3d& box_map) {
  TilesOfBox tiles;
  std::size_t non_resident = 0;
  requests_.run([&] {
    const StaticMap& map = mapper_.static_map();
    const std::size_t resident = map.memory_use().resident_tiles;
    tiles = {latest_map_.view()->map_id, map.tiles_in(box_map, max_stored_tiles + resident + 1),
             tile_store_};
    // At least so many.
    non_resident = map.non_resident_among(tiles.ids);
  });
  if (non_resident > max_stored_tiles) {
    throw std::invalid_argument("the region has " + std::to_string(non_resident) +
                                " tiles or more that are on disk; at most " +
                                std::to_string(max_stored_tiles) +
                                " can be answered: ask for parts");
  }
  return tiles;
}

void MappingThread::run_on_some(std::uint64_t map_id, std::span<const TileId>& left,
                                const std::function<bool(std::span<const TileId> some)>& action) {
  requests_.run([&] {
    if (latest_map_.view()->map_id != map_id) {
      throw std::runtime_error("another map began meanwhile; ask again for that one");
    }
    bool goes_on = true;
    while (!left.empty() && goes_on) {
      const auto some = left.first(std::min(left.size(), tiles_at_once));
      goes_on = action(some) && queue_.waiting() == 0;
      left = left.subspan(some.size());
    }
  });
}

}  // namespace stillmap::server
