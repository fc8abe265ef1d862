#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <vector>

#include "core/map/tile.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/map_identity.hpp"
#include "idl/interface/topics.hpp"
#include "stillmap_msgs.h"

namespace stillmap::server {

/// Limits bytes to a rate, with bursts of up to a second's worth of it. Not thread-safe.
class TokenBucket {
 public:
  using Clock = std::chrono::steady_clock;

  /// 0: any number of bytes.
  explicit TokenBucket(std::uint32_t bytes_per_s) : bytes_per_s_(bytes_per_s) {}

  /// Adds the tokens for the time since the last call.
  void refill(Clock::time_point now);
  /// Whether a message may be sent now. It may take more tokens than are left; the debt delays the
  /// next one.
  [[nodiscard]] bool has_tokens() const { return bytes_per_s_ == 0.0 || tokens_ > 0.0; }
  void consume(std::size_t bytes) { tokens_ -= static_cast<double>(bytes); }

 private:
  double bytes_per_s_;
  double tokens_ = 0.0;
  std::optional<Clock::time_point> refilled_;
};

/// Publishes every tile that changed, first its voxels and then its entry in the index. Tiles that
/// no longer exist are disposed, and their entry becomes empty. Of evicted tiles, late joiners get
/// the entry alone. Where the participant's options limit the rate of large messages, new tiles
/// take half of it: those published longest ago go first, and a tile that changes while it waits is
/// sent once, in its newest state.
///
/// A tile is never replaced while a reader is still receiving it (unless that takes longer than a
/// lease): Fast DDS 2.9 readers abort when they have some fragments of a keyed sample and are then
/// told that the rest will not come.
class TilePublisher {
 public:
  TilePublisher(dds::Participant& participant, const dds::Topics& topics);

  /// Publishes what is new in the view, as far as the rate allows now; call it again with the same
  /// view to continue.
  void publish(const std::shared_ptr<const MapSnapshot>& latest);
  /// Tiles of the last view that are not published yet.
  [[nodiscard]] std::size_t waiting() const { return waiting_; }

 private:
  using TilePointers = std::vector<std::shared_ptr<const Tile>>;

  /// Tiles of the view that readers do not have, those published longest ago first.
  [[nodiscard]] TilePointers pending_tiles(const MapSnapshot& view) const;
  /// All readers have acknowledged the last burst, or it was sent longer than a lease ago.
  [[nodiscard]] bool last_burst_acknowledged();
  void publish_pending(const TilePointers& tiles, const dds::MapIdentity& identity);
  void publish_tile(const Tile& tile, const dds::MapIdentity& identity);
  void drop_evicted_voxels(const MapSnapshot& view, const dds::MapIdentity& identity);
  void drop_voxels(const Tile& tile, const dds::MapIdentity& identity);
  void dispose_missing_tiles(const MapSnapshot& view, const dds::MapIdentity& identity);

  dds::Writer<stillmap_msgs::msg::MapTile> tiles_;
  dds::Writer<stillmap_msgs::msg::TileInfo> index_;
  TokenBucket token_bucket_;
  std::chrono::seconds max_wait_;
  std::chrono::steady_clock::time_point last_burst_;
  std::uint64_t map_id_ = 0;
  std::size_t waiting_ = 0;
  std::uint64_t publications_ = 0;
  std::shared_ptr<const MapSnapshot> last_view_;
  /// What was published of a tile.
  struct Published {
    std::uint64_t revision = 0;
    /// Late joiners get the voxels, too.
    bool has_voxels = false;
    /// Number of the publication that brought it.
    std::uint64_t publication = 0;
  };
  std::map<TileId, Published> published_;
};

}  // namespace stillmap::server
