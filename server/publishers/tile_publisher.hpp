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
/// back tiles that are gone: their voxels are disposed, their entry says that nothing is left.
class TilePublisher {
 public:
  TilePublisher(Participant& participant, const Topics& topics);

  void publish(const MapView& view);

 private:
  void publish_tile(const Tile& tile, const MapIdentity& identity);
  void take_back_missing(const MapView& view, const MapIdentity& identity);

  Writer<stillmap_msgs::msg::MapTile> tiles_;
  Writer<stillmap_msgs::msg::TileInfo> index_;
  std::uint64_t map_id_ = 0;
  std::uint64_t version_ = 0;
  /// What readers have: revision of every tile.
  std::map<TileId, std::uint64_t> published_;
};

}  // namespace stillmap
