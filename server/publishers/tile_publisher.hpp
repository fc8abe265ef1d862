#pragma once

#include <cstdint>
#include <map>
#include <memory>

#include "core/map/tile.hpp"
#include "idl/dds/writer.hpp"
#include "idl/map_identity.hpp"
#include "idl/topics.hpp"
#include "stillmap_msgs.h"

namespace stillmap {

/// Publishes every tile that changed, first its voxels and then its entry in the index, and takes
/// back tiles that are gone: their voxels are disposed, their entry says that nothing is left. Of
/// tiles that left memory, late joiners get the entry alone.
class TilePublisher {
 public:
  TilePublisher(Participant& participant, const Topics& topics);

  void publish(const std::shared_ptr<const MapView>& shown);

 private:
  void publish_tile(const Tile& tile, const MapIdentity& identity);
  void forget_voxels(const Tile& tile, const MapIdentity& identity);
  void take_back_missing(const MapView& view, const MapIdentity& identity);

  Writer<stillmap_msgs::msg::MapTile> tiles_;
  Writer<stillmap_msgs::msg::TileInfo> index_;
  std::uint64_t map_id_ = 0;
  std::shared_ptr<const MapView> last_view_;
  /// What readers have of a tile.
  struct Published {
    std::uint64_t revision = 0;
    /// A late joiner gets the voxels, too.
    bool has_voxels = false;
  };
  std::map<TileId, Published> published_;
};

}  // namespace stillmap
