#include "core/map/query/tile_reader.hpp"

#include <algorithm>
#include <string>
#include <utility>

namespace stillmap {
namespace {

std::size_t bytes_of(const Tile& tile) {
  return sizeof(Tile) + tile.voxels.capacity() * sizeof(Voxel);
}

bool is_state(const TileInfo& a, const TileInfo& b) {
  return a.id == b.id && a.revision == b.revision && a.content_hash == b.content_hash;
}

}  // namespace

TileReader::TileReader(std::shared_ptr<TileShelf> shelf, std::size_t kept_bytes)
    : shelf_(std::move(shelf)), kept_bytes_(kept_bytes) {}

void TileReader::use_shelf(std::shared_ptr<TileShelf> shelf) {
  const std::scoped_lock lock(mutex_);
  shelf_ = std::move(shelf);
  kept_.clear();
  bytes_ = 0;
}

std::shared_ptr<TileShelf> TileReader::shelf() {
  const std::scoped_lock lock(mutex_);
  return shelf_;
}

std::shared_ptr<const Tile> TileReader::whole(const std::shared_ptr<const Tile>& tile) {
  if (!is_away(*tile)) return tile;
  const TileInfo& wanted = tile->info;
  if (auto known = kept(wanted)) return known;
  const auto from = shelf();
  auto read = from == nullptr ? nullptr : from->take(wanted.id).tile;
  if (read == nullptr || !is_state(read->info, wanted)) {
    throw TileChanged("tile (" + std::to_string(wanted.id.x) + ", " + std::to_string(wanted.id.y) +
                      ") changed while it was asked for; ask again");
  }
  keep(read);
  return read;
}

MapView TileReader::with_voxels(const MapView& view, const std::vector<std::size_t>& tiles) {
  MapView whole_view = view;
  for (const std::size_t i : tiles) whole_view.tiles[i] = whole(view.tiles[i]);
  return whole_view;
}

std::shared_ptr<const Tile> TileReader::kept(const TileInfo& wanted) {
  const std::scoped_lock lock(mutex_);
  const auto found =
      std::ranges::find_if(kept_, [&](const auto& tile) { return is_state(tile->info, wanted); });
  if (found == kept_.end()) return nullptr;
  kept_.splice(kept_.begin(), kept_, found);
  return kept_.front();
}

void TileReader::keep(std::shared_ptr<const Tile> tile) {
  const std::scoped_lock lock(mutex_);
  bytes_ += bytes_of(*tile);
  kept_.push_front(std::move(tile));
  while (bytes_ > kept_bytes_ && !kept_.empty()) {
    bytes_ -= bytes_of(*kept_.back());
    kept_.pop_back();
  }
}

}  // namespace stillmap
