#include "core/map/query/tile_reader.hpp"

#include <algorithm>
#include <string>
#include <utility>

namespace stillmap {
namespace {

std::size_t bytes_of(const Tile& tile) { return sizeof(Tile) + tile.voxels.memory_bytes(); }

bool is_state(const TileInfo& a, const TileInfo& b) {
  return a.id == b.id && a.revision == b.revision && a.content_hash == b.content_hash;
}

}  // namespace

TileReader::TileReader(std::shared_ptr<TileStore> tile_store, std::size_t cache_bytes)
    : tile_store_(std::move(tile_store)), cache_bytes_(cache_bytes) {}

void TileReader::use_tile_store(std::shared_ptr<TileStore> tile_store) {
  const std::scoped_lock lock(mutex_);
  tile_store_ = std::move(tile_store);
  cache_.clear();
  bytes_ = 0;
}

std::shared_ptr<TileStore> TileReader::tile_store() {
  const std::scoped_lock lock(mutex_);
  return tile_store_;
}

std::shared_ptr<const Tile> TileReader::read(const std::shared_ptr<const Tile>& tile) {
  if (!is_non_resident(*tile)) return tile;
  const TileInfo& wanted = tile->info;
  if (auto known = find_cached(wanted)) return known;
  const auto from = tile_store();
  auto read = from == nullptr ? nullptr : from->load(wanted.id).tile;
  if (read == nullptr || !is_state(read->info, wanted)) {
    throw TileChanged("tile (" + std::to_string(wanted.id.x) + ", " + std::to_string(wanted.id.y) +
                      ") changed while it was asked for; ask again");
  }
  cache(read);
  return read;
}

std::shared_ptr<const Tile> TileReader::find_cached(const TileInfo& wanted) {
  const std::scoped_lock lock(mutex_);
  const auto found =
      std::ranges::find_if(cache_, [&](const auto& tile) { return is_state(tile->info, wanted); });
  if (found == cache_.end()) return nullptr;
  cache_.splice(cache_.begin(), cache_, found);
  return cache_.front();
}

void TileReader::cache(std::shared_ptr<const Tile> tile) {
  const std::scoped_lock lock(mutex_);
  bytes_ += bytes_of(*tile);
  cache_.push_front(std::move(tile));
  while (bytes_ > cache_bytes_ && !cache_.empty()) {
    bytes_ -= bytes_of(*cache_.back());
    cache_.pop_back();
  }
}

}  // namespace stillmap
