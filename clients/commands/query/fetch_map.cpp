#include "clients/commands/query/fetch_map.hpp"

#include <algorithm>
#include <condition_variable>
#include <memory>
#include <mutex>
#include <utility>

namespace stillmap::cli {

Trajectory fetch_trajectory(Client& client, std::chrono::milliseconds timeout) {
  std::mutex mutex;
  std::condition_variable arrived;
  Trajectory newest;
  // The server keeps its path for those who come late.
  const Subscription subscription = client.subscribe_path([&](const Trajectory& path) {
    const std::lock_guard lock(mutex);
    newest = path;
    arrived.notify_one();
  });
  std::unique_lock lock(mutex);
  if (!arrived.wait_for(lock, timeout, [&] { return !newest.empty(); })) {
    throw ServiceTimeout("the server has no pose yet: it has mapped no scan");
  }
  return newest;
}

MapSnapshot fetch_map(Client& client) {
  const TileVersions versions = client.get_tile_versions();
  std::vector<TileId> ids;
  for (const TileInfo& info : versions.tiles) ids.push_back(info.id);
  TileSet set = client.get_tiles(ids);
  MapSnapshot view{.version = set.map.version,
                   .map_id = set.map.map_id,
                   .tile_size_m = versions.map.tile_size_m,
                   .voxel_size_m = versions.map.voxel_size_m,
                   .tiles = {}};
  std::vector<std::shared_ptr<const Tile>> tiles;
  tiles.reserve(set.tiles.size());
  for (Tile& tile : set.tiles) tiles.push_back(std::make_shared<const Tile>(std::move(tile)));
  view.tiles = TileTable(std::move(tiles));
  return view;
}

}  // namespace stillmap::cli
