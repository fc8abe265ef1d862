#include "server/publishers/tile_publisher.hpp"

#include <algorithm>
#include <utility>

#include "core/map/tile_evidence.hpp"
#include "idl/conversions/tile.hpp"

namespace stillmap::server {

namespace {

// The other half is for late joiners, repairs and answers.
constexpr std::uint32_t new_tile_share = 2;

/// About what the tile's message has on the wire.
std::size_t message_bytes(const Tile& tile) {
  constexpr std::size_t bytes_per_voxel = 27;
  constexpr std::size_t head_bytes = 150;
  return head_bytes + bytes_per_voxel * tile.voxels.size();
}

}  // namespace

void TokenBucket::refill(Clock::time_point now) {
  const double seconds = refilled_ ? std::chrono::duration<double>(now - *refilled_).count() : 1.0;
  tokens_ = std::min(tokens_ + seconds * bytes_per_s_, bytes_per_s_);
  refilled_ = now;
}

TilePublisher::TilePublisher(dds::Participant& participant, const dds::Topics& topics)
    : tiles_(participant, topics.tiles.dds_name, topics.tiles.writer),
      index_(participant, topics.tile_index.dds_name, topics.tile_index.writer),
      token_bucket_(participant.options().large_message_bytes_per_s / new_tile_share),
      max_wait_(participant.options().lease_s) {}

void TilePublisher::publish(const std::shared_ptr<const MapSnapshot>& latest) {
  token_bucket_.refill(TokenBucket::Clock::now());
  // A view of the same version may differ in which tiles are resident.
  if (latest == last_view_ && waiting_ == 0) return;
  last_view_ = latest;
  const MapSnapshot& view = *latest;
  const dds::MapIdentity identity = wire::identity_of(view);
  // Tiles of another map are new whatever their revision.
  if (view.map_id != std::exchange(map_id_, view.map_id)) {
    for (auto& [id, known] : published_) known.revision = 0;
  }
  dispose_missing_tiles(view, identity);
  drop_evicted_voxels(view, identity);
  publish_pending(pending_tiles(view), identity);
}

TilePublisher::TilePointers TilePublisher::pending_tiles(const MapSnapshot& view) const {
  std::vector<std::pair<std::uint64_t, std::shared_ptr<const Tile>>> pending_tiles;
  for (const auto& tile : view.tiles) {
    const auto known = published_.find(tile->info.id);
    const bool is_known =
        known != published_.end() && known->second.revision == tile->info.revision;
    if (is_known && (known->second.has_voxels || is_non_resident(*tile))) continue;
    pending_tiles.emplace_back(known == published_.end() ? 0 : known->second.publication, tile);
  }
  std::ranges::stable_sort(pending_tiles, {}, [](const auto& entry) { return entry.first; });
  TilePointers tiles;
  for (auto& [publication, tile] : pending_tiles) tiles.push_back(std::move(tile));
  return tiles;
}

void TilePublisher::publish_pending(const TilePointers& tiles, const dds::MapIdentity& identity) {
  waiting_ = tiles.size();
  if (tiles.empty() || !last_burst_acknowledged()) return;
  last_burst_ = std::chrono::steady_clock::now();
  for (const auto& tile : tiles) {
    if (!token_bucket_.has_tokens()) return;
    publish_tile(*tile, identity);
    token_bucket_.consume(message_bytes(*tile));
    --waiting_;
  }
}

bool TilePublisher::last_burst_acknowledged() {
  return tiles_.wait_for_acknowledgements(std::chrono::milliseconds(0)) ||
         std::chrono::steady_clock::now() - last_burst_ > max_wait_;
}

void TilePublisher::publish_tile(const Tile& tile, const dds::MapIdentity& identity) {
  // Keep-last writers always have room.
  if (!is_non_resident(tile)) static_cast<void>(tiles_.write(wire::to_wire(tile, identity)));
  static_cast<void>(index_.write(wire::to_wire(tile.info, identity)));
  published_[tile.info.id] = {tile.info.revision, !is_non_resident(tile), ++publications_};
}

void TilePublisher::drop_evicted_voxels(const MapSnapshot& view, const dds::MapIdentity& identity) {
  for (const auto& tile : view.tiles) {
    if (!is_non_resident(*tile)) continue;
    const auto known = published_.find(tile->info.id);
    if (known != published_.end() && known->second.has_voxels) drop_voxels(*tile, identity);
  }
}

void TilePublisher::drop_voxels(const Tile& tile, const dds::MapIdentity& identity) {
  // Without its voxels: only the key counts.
  tiles_.unregister(wire::to_wire(tile, identity));
  published_[tile.info.id].has_voxels = false;
}

void TilePublisher::dispose_missing_tiles(const MapSnapshot& view,
                                          const dds::MapIdentity& identity) {
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

}  // namespace stillmap::server
