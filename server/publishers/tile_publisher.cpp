#include "server/publishers/tile_publisher.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

#include "idl/conversions/tile.hpp"

namespace stillmap::server {

namespace {

// The other half is for late joiners, repairs and answers.
constexpr std::uint32_t new_tile_share = 2;

/// About what an entry of the index has on the wire.
constexpr std::size_t entry_bytes = 150;

/// About what the tile's message has on the wire.
std::size_t message_bytes(const TileInfo& tile) {
  constexpr std::size_t bytes_per_voxel = 27;
  constexpr std::size_t head_bytes = 150;
  return head_bytes + bytes_per_voxel * tile.voxel_count;
}

}  // namespace

void TokenBucket::refill(Clock::time_point now) {
  const double seconds = refilled_ ? std::chrono::duration<double>(now - *refilled_).count() : 1.0;
  tokens_ = std::min(tokens_ + seconds * bytes_per_s_, bytes_per_s_);
  refilled_ = now;
}

TilePublisher::TilePublisher(dds::Participant& participant, const dds::Topics& topics,
                             TileReader& tiles, double window_m)
    : tiles_(participant, topics.tiles.dds_name, topics.tiles.writer),
      index_(participant, topics.tile_index.dds_name, topics.tile_index.writer),
      reader_(tiles),
      window_m_(window_m),
      token_bucket_(participant.options().large_message_bytes_per_s / new_tile_share),
      max_wait_(participant.options().lease_s) {}

void TilePublisher::publish(const std::shared_ptr<const MapSnapshot>& latest,
                            const Eigen::Vector2d& robot_map) {
  token_bucket_.refill(TokenBucket::Clock::now());
  const MapSnapshot& view = *latest;
  const Eigen::Vector3d half(window_m_ / 2.0, window_m_ / 2.0, 0.0);
  const Eigen::Vector3d centre_map(robot_map.x(), robot_map.y(), 0.0);
  const TileRange window =
      view.tile_size_m > 0.0 ? tile_range({centre_map - half, centre_map + half}, view.tile_size_m)
                             : TileRange{};
  const bool is_same_window = window.first == window_.first && window.last == window_.last;
  if (latest == last_view_ && is_same_window && waiting() == 0) return;
  const dds::MapIdentity identity = wire::identity_of(view);
  window_ = window;
  const bool is_other_map = !last_view_ || view.map_id != last_view_->map_id;
  is_other_map ? begin_map(view) : note_changes(view);
  if (is_other_map || !is_same_window) note_window(view);
  last_view_ = latest;
  publish_pending(view, identity);
}

void TilePublisher::begin_map(const MapSnapshot& view) {
  pending_.clear();
  gone_.clear();
  undisposed_.clear();
  for (auto& [id, known] : published_) {
    known.revision = 0;
    known.entry.reset();
    (view.tiles.find(id) == nullptr ? gone_ : pending_).insert(id);
  }
}

void TilePublisher::note_changes(const MapSnapshot& view) {
  TileTable::for_each_difference(
      last_view_->tiles, view.tiles, [&](const auto& before, const auto& after) {
        if (after == nullptr) {
          pending_.erase(before->info.id);
          gone_.insert(before->info.id);
        } else if (before == nullptr || before->info.revision != after->info.revision) {
          // Tiles that were evicted or reloaded are the same to readers.
          gone_.erase(after->info.id);
          undisposed_.erase(after->info.id);
          pending_.insert(after->info.id);
        }
      });
}

void TilePublisher::note_window(const MapSnapshot& view) {
  for (const auto& tile : tiles_in_range(view.tiles, window_)) {
    const auto known = published_.find(tile->info.id);
    if (known == published_.end() || known->second.revision != tile->info.revision) {
      pending_.insert(tile->info.id);
    }
  }
}

bool TilePublisher::is_in_window(TileId id) const {
  return id.x >= window_.first.x && id.x <= window_.last.x && id.y >= window_.first.y &&
         id.y <= window_.last.y;
}

TilePublisher::TilePointers TilePublisher::pending_tiles(const MapSnapshot& view) const {
  std::vector<std::pair<std::uint64_t, std::shared_ptr<const Tile>>> pending;
  for (const TileId id : pending_) {
    const auto known = published_.find(id);
    pending.emplace_back(known == published_.end() ? 0 : known->second.publication,
                         view.tiles.find(id));
  }
  std::ranges::stable_sort(pending, {}, [](const auto& entry) { return entry.first; });
  TilePointers tiles;
  for (auto& [publication, tile] : pending) tiles.push_back(std::move(tile));
  return tiles;
}

void TilePublisher::publish_pending(const MapSnapshot& view, const dds::MapIdentity& identity) {
  for (const TileId id : std::exchange(gone_, {})) announce_gone(id, view, identity);
  const bool may_send = last_burst_acknowledged();
  if (may_send) {
    dispose_gone(view, identity);
    release_far_tiles(identity);
  }
  if (pending_.empty()) return;
  if (may_send) last_burst_ = std::chrono::steady_clock::now();
  for (const auto& tile : pending_tiles(view)) {
    if (!token_bucket_.has_tokens()) return;
    may_send ? publish_tile(tile, identity) : announce(tile->info, identity);
  }
}

bool TilePublisher::last_burst_acknowledged() {
  return tiles_.wait_for_acknowledgements(std::chrono::milliseconds(0)) ||
         std::chrono::steady_clock::now() - last_burst_ > max_wait_;
}

void TilePublisher::publish_tile(const std::shared_ptr<const Tile>& tile,
                                 const dds::MapIdentity& identity) {
  std::uint64_t revision = tile->info.revision;
  // Keep-last writers always have room.
  try {
    const auto whole = reader_.read(tile);
    static_cast<void>(tiles_.write(wire::to_wire(*whole, identity)));
    token_bucket_.consume(message_bytes(whole->info));
  } catch (const std::runtime_error&) {
    // On the disk, and changed since or not to be read now: the entry alone. The tile follows when
    // it changes, or is in the window when that moves.
    revision = 0;
  }
  static_cast<void>(index_.write(wire::to_wire(tile->info, identity)));
  published_[tile->info.id] = {revision, ++publications_, tile->info.revision};
  pending_.erase(tile->info.id);
}

void TilePublisher::announce(const TileInfo& info, const dds::MapIdentity& identity) {
  Published& known = published_[info.id];
  if (known.entry == info.revision) return;
  known.entry = info.revision;
  // Else one that goes on changing would stay before all others whose entry waits for tokens.
  known.publication = ++publications_;
  static_cast<void>(index_.write(wire::to_wire(info, identity)));
  // The voxels are charged when they are sent.
  token_bucket_.consume(entry_bytes);
}

void TilePublisher::announce_gone(TileId id, const MapSnapshot& view,
                                  const dds::MapIdentity& identity) {
  const TileInfo gone{.id = id, .revision = view.version, .bounds_map = {}};
  // Disposed samples do not pass content filters: the index says it with an empty tile.
  static_cast<void>(index_.write(wire::to_wire(gone, identity)));
  if (published_.contains(id)) undisposed_.insert(id);
  published_[id] = {0, ++publications_, std::nullopt};
}

void TilePublisher::dispose_gone(const MapSnapshot& view, const dds::MapIdentity& identity) {
  for (const TileId id : std::exchange(undisposed_, {})) {
    Tile gone;
    gone.info = {.id = id, .revision = view.version, .bounds_map = {}};
    tiles_.dispose(wire::to_wire(gone, identity));
  }
}

void TilePublisher::release_far_tiles(const dds::MapIdentity& identity) {
  std::vector<std::pair<std::uint64_t, TileId>> far;
  for (const auto& [id, known] : published_) {
    if (!is_in_window(id)) far.emplace_back(known.publication, id);
  }
  if (far.size() <= max_far_tiles) return;
  std::ranges::sort(far);
  far.resize(far.size() - max_far_tiles);
  for (const auto& [publication, id] : far) {
    // Only the key counts.
    Tile key;
    key.info.id = id;
    tiles_.unregister(wire::to_wire(key, identity));
    index_.unregister(wire::to_wire(key.info, identity));
    published_.erase(id);
  }
}

}  // namespace stillmap::server
