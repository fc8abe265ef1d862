#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <vector>

#include "core/map/query/tile_reader.hpp"
#include "core/map/tile.hpp"
#include "core/map/voxel_grid.hpp"
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

/// Publishes the tiles in a window round the robot, and every tile that changes: first its voxels
/// and then its entry in the index. The entry of a tile that no longer exists becomes empty, and
/// the tile is disposed. Late joiners get the window and the tiles that changed last elsewhere,
/// however large the map is; the rest is theirs to ask for. Where the participant's options limit
/// the rate of large messages, new tiles take half of it: those published longest ago go first, and
/// a tile that changes while it waits is sent once, in its newest state.
///
/// A tile is never replaced or disposed while a reader is still receiving it (unless that takes
/// longer than a lease): Fast DDS 2.9 readers abort when they have some fragments of a keyed sample
/// and are then told that the rest will not come. Entries do not wait for that: a reader of tiles
/// that was stopped would keep them from all others. The entry of a tile that waits is written at
/// once, and again after its voxels; of a limited rate it takes its own bytes alone.
class TilePublisher {
 public:
  /// Tiles outside the window that late joiners get, too.
  static constexpr std::size_t max_far_tiles = 256;

  /// `window_m` is the window's edge. Tiles in it that are not in memory are read through `tiles`.
  TilePublisher(dds::Participant& participant, const dds::Topics& topics, TileReader& tiles,
                double window_m);

  /// Publishes what is new in the view, as far as the rate allows now; call it again with the same
  /// view to continue. `robot_map` is where the window is [m].
  void publish(const std::shared_ptr<const MapSnapshot>& latest, const Eigen::Vector2d& robot_map);
  /// Tiles that are not published yet, and those that readers still take to be there.
  [[nodiscard]] std::size_t waiting() const {
    return pending_.size() + gone_.size() + undisposed_.size();
  }
  /// Tiles that late joiners get.
  [[nodiscard]] std::size_t held() const { return published_.size(); }

 private:
  using TilePointers = std::vector<std::shared_ptr<const Tile>>;

  /// Another map, or the first: what was published is not of it.
  void begin_map(const MapSnapshot& view);
  /// Notes what differs from the last view.
  void note_changes(const MapSnapshot& view);
  /// Notes the window's tiles that are not published.
  void note_window(const MapSnapshot& view);
  [[nodiscard]] bool is_in_window(TileId id) const;
  /// Tiles that readers do not have, those published longest ago first.
  [[nodiscard]] TilePointers pending_tiles(const MapSnapshot& view) const;
  /// All readers have acknowledged the last burst, or it was sent longer than a lease ago.
  [[nodiscard]] bool last_burst_acknowledged();
  void publish_pending(const MapSnapshot& view, const dds::MapIdentity& identity);
  void publish_tile(const std::shared_ptr<const Tile>& tile, const dds::MapIdentity& identity);
  /// The entry alone, unless it is published.
  void announce(const TileInfo& info, const dds::MapIdentity& identity);
  void announce_gone(TileId id, const MapSnapshot& view, const dds::MapIdentity& identity);
  void dispose_gone(const MapSnapshot& view, const dds::MapIdentity& identity);
  /// Late joiners no longer get tiles that are far and changed long ago; who has them keeps them.
  void release_far_tiles(const dds::MapIdentity& identity);

  dds::Writer<stillmap_msgs::msg::MapTile> tiles_;
  dds::Writer<stillmap_msgs::msg::TileInfo> index_;
  TileReader& reader_;
  double window_m_;
  TokenBucket token_bucket_;
  std::chrono::seconds max_wait_;
  std::chrono::steady_clock::time_point last_burst_;
  std::uint64_t publications_ = 0;
  std::shared_ptr<const MapSnapshot> last_view_;
  TileRange window_;
  std::set<TileId> pending_;
  /// Those that no longer exist, and readers were not told.
  std::set<TileId> gone_;
  /// Those whose entry says so, and which readers of tiles still have.
  std::set<TileId> undisposed_;
  /// What was published of a tile.
  struct Published {
    /// 0: of another map, the tile is gone, or it could not be read.
    std::uint64_t revision = 0;
    /// Number of the publication that brought it.
    std::uint64_t publication = 0;
    /// Revision in its entry, where that is of this map.
    std::optional<std::uint64_t> entry{};
  };
  std::map<TileId, Published> published_;
};

}  // namespace stillmap::server
