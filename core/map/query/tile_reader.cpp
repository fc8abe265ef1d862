#include "core/map/query/tile_reader.hpp"

#include <algorithm>
#include <string>
#include <utility>

namespace stillmap {
namespace {

/// With what the cache knows it by.
std::size_t bytes_of(const Tile& tile) {
  constexpr std::size_t entry_bytes = sizeof(TileInfo) + 128;
  return sizeof(Tile) + tile.voxels.memory_bytes() + entry_bytes;
}

}  // namespace

std::size_t TileReader::StateHash::operator()(const TileInfo& info) const {
  // Equal content is no rarity: level ground has it in many places.
  constexpr std::uint64_t x_factor = 0x9E3779B97F4A7C15;
  constexpr std::uint64_t y_factor = 0xC2B2AE3D27D4EB4F;
  return info.content_hash ^ (static_cast<std::uint64_t>(info.id.x) * x_factor) ^
         (static_cast<std::uint64_t>(info.id.y) * y_factor);
}

bool TileReader::IsSameState::operator()(const TileInfo& a, const TileInfo& b) const {
  return a.id == b.id && a.revision == b.revision && a.content_hash == b.content_hash;
}

TileReader::TileReader(std::shared_ptr<TileStore> tile_store, std::size_t cache_bytes)
    : tile_store_(std::move(tile_store)), cache_bytes_(cache_bytes) {}

void TileReader::use_tile_store(std::shared_ptr<TileStore> tile_store) {
  const std::scoped_lock lock(mutex_);
  tile_store_ = std::move(tile_store);
  entries_.clear();
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
  if (read == nullptr || !IsSameState()(read->info, wanted)) {
    throw TileChanged("tile (" + std::to_string(wanted.id.x) + ", " + std::to_string(wanted.id.y) +
                      ") changed while it was asked for; ask again");
  }
  cache(read);
  return read;
}

std::shared_ptr<const Tile> TileReader::find_cached(const TileInfo& wanted) {
  const std::scoped_lock lock(mutex_);
  const auto entry = entries_.find(wanted);
  if (entry == entries_.end()) return nullptr;
  cache_.splice(cache_.begin(), cache_, entry->second);
  return cache_.front();
}

void TileReader::cache(std::shared_ptr<const Tile> tile) {
  const std::scoped_lock lock(mutex_);
  // Another thread may have read it meanwhile.
  if (entries_.contains(tile->info)) return;
  bytes_ += bytes_of(*tile);
  cache_.push_front(std::move(tile));
  entries_.emplace(cache_.front()->info, cache_.begin());
  while (bytes_ > cache_bytes_ && !cache_.empty()) drop_oldest();
}

void TileReader::drop_oldest() {
  bytes_ -= bytes_of(*cache_.back());
  entries_.erase(cache_.back()->info);
  cache_.pop_back();
}

}  // namespace stillmap
