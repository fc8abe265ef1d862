#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "core/map/tile.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/map_identity.hpp"
#include "idl/interface/topics.hpp"
#include "server/publishers/token_bucket.hpp"
#include "stillmap_msgs.h"

namespace stillmap::server {

/// Publishes every tile that changed, first its voxels and then its entry in the index, and takes
/// back tiles that are gone: their voxels are disposed, their entry says that nothing is left. Of
/// tiles that left memory, late joiners get the entry alone. Where the participant's options limit
/// large messages, new tiles take half of that: those go first that were sent longest ago, and what
/// changes while it waits is sent once, as it is then.
///
/// A tile is never replaced while a reader is still getting it (unless that takes longer than a
/// lease): Fast DDS 2.9 readers abort when they have some fragments of a keyed sample and are then
/// told that the rest will not come.
class TilePublisher {
 public:
  TilePublisher(dds::Participant& participant, const dds::Topics& topics);

  /// Publishes what of the view is new and may be sent now; called again with the same view, it
  /// goes on.
  void publish(const std::shared_ptr<const MapSnapshot>& latest);
  /// Tiles of the last view that are not published yet.
  [[nodiscard]] std::size_t waiting() const { return waiting_; }

 private:
  using TilePointers = std::vector<std::shared_ptr<const Tile>>;

  /// What readers do not have of the view; what they know longest goes first.
  [[nodiscard]] TilePointers pending_tiles(const MapSnapshot& view) const;
  /// All readers have what was sent, or one of them takes longer than a lease.
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
  /// What readers have of a tile.
  struct Published {
    std::uint64_t revision = 0;
    /// A late joiner gets the voxels, too.
    bool has_voxels = false;
    /// Number of the publication that brought it.
    std::uint64_t publication = 0;
  };
  std::map<TileId, Published> published_;
};

}  // namespace stillmap::server
