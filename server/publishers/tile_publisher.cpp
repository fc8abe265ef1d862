#include "server/publishers/tile_publisher.hpp"

#include <algorithm>
#include <utility>

#include "core/map/tile_store.hpp"
#include "idl/conversions/tile.hpp"

namespace stillmap {

namespace {

// The other half is for late joiners, repairs and answers.
constexpr std::uint32_t share_of_news = 2;

/// About what the tile's message has on the wire.
std::size_t message_bytes(const Tile& tile) {
  constexpr std::size_t bytes_per_voxel = 27;
  constexpr std::size_t head_bytes = 150;
  return head_bytes + bytes_per_voxel * tile.voxels.size();
}

}  // namespace

TilePublisher::TilePublisher(Participant& participant, const Topics& topics)
    : tiles_(participant, topics.tiles.dds_name, topics.tiles.writer),
      index_(participant, topics.tile_index.dds_name, topics.tile_index.writer),
      allowance_(participant.options().bulk_bytes_per_s / share_of_news),
      longest_wait_(participant.options().lease_s) {}

void TilePublisher::publish(const std::shared_ptr<const MapView>& shown) {
  allowance_.refill(ByteAllowance::Clock::now());
  // A view of the same version may have tiles in other places: in memory, or away.
  if (shown == last_view_ && waiting_ == 0) return;
  last_view_ = shown;
  const MapView& view = *shown;
  const MapIdentity identity = wire::identity_of(view);
  // Tiles of another map are news whatever their revision.
  if (view.map_id != std::exchange(map_id_, view.map_id)) {
    for (auto& [id, known] : published_) known.revision = 0;
  }
  take_back_missing(view, identity);
  forget_voxels_away(view, identity);
  publish_news(news(view), identity);
}

TilePublisher::TilePointers TilePublisher::news(const MapView& view) const {
  std::vector<std::pair<std::uint64_t, std::shared_ptr<const Tile>>> news;
  for (const auto& tile : view.tiles) {
    const auto known = published_.find(tile->info.id);
    const bool is_known =
        known != published_.end() && known->second.revision == tile->info.revision;
    if (is_known && (known->second.has_voxels || is_away(*tile))) continue;
    news.emplace_back(known == published_.end() ? 0 : known->second.publication, tile);
  }
  std::ranges::stable_sort(news, {}, [](const auto& entry) { return entry.first; });
  TilePointers tiles;
  for (auto& [publication, tile] : news) tiles.push_back(std::move(tile));
  return tiles;
}

void TilePublisher::publish_news(const TilePointers& tiles, const MapIdentity& identity) {
  waiting_ = tiles.size();
  if (tiles.empty() || !last_news_arrived()) return;
  last_news_ = std::chrono::steady_clock::now();
  for (const auto& tile : tiles) {
    if (!allowance_.allows()) return;
    publish_tile(*tile, identity);
    allowance_.spend(message_bytes(*tile));
    --waiting_;
  }
}

bool TilePublisher::last_news_arrived() {
  return tiles_.wait_for_acknowledgements(std::chrono::milliseconds(0)) ||
         std::chrono::steady_clock::now() - last_news_ > longest_wait_;
}

void TilePublisher::publish_tile(const Tile& tile, const MapIdentity& identity) {
  // Keep-last writers always have room.
  if (!is_away(tile)) static_cast<void>(tiles_.write(wire::to_wire(tile, identity)));
  static_cast<void>(index_.write(wire::to_wire(tile.info, identity)));
  published_[tile.info.id] = {tile.info.revision, !is_away(tile), ++publications_};
}

void TilePublisher::forget_voxels_away(const MapView& view, const MapIdentity& identity) {
  for (const auto& tile : view.tiles) {
    if (!is_away(*tile)) continue;
    const auto known = published_.find(tile->info.id);
    if (known != published_.end() && known->second.has_voxels) forget_voxels(*tile, identity);
  }
}

void TilePublisher::forget_voxels(const Tile& tile, const MapIdentity& identity) {
  // Without its voxels: only the key counts.
  tiles_.forget(wire::to_wire(tile, identity));
  published_[tile.info.id].has_voxels = false;
}

void TilePublisher::take_back_missing(const MapView& view, const MapIdentity& identity) {
  const auto is_gone = [&](const auto& entry) {
    const auto found = std::ranges::lower_bound(view.tiles, entry.first, {},
                                                [](const auto& tile) { return tile->info.id; });
    return found == view.tiles.end() || (*found)->info.id != entry.first;
  };
  std::erase_if(published_, [&](const auto& entry) {
    if (!is_gone(entry)) return false;
    Tile gone;
    gone.info = {.id = entry.first, .revision = view.version, .bounds_map = {}};
    tiles_.dispose(wire::to_wire(gone, identity));
    // Disposed samples do not pass content filters: the index says it with an empty tile.
    static_cast<void>(index_.write(wire::to_wire(gone.info, identity)));
    return true;
  });
}

}  // namespace stillmap
