#pragma once

#include <cstdint>
#include <optional>

#include "core/map/tile.hpp"
#include "idl/interface/map_identity.hpp"
#include "stillmap_msgs.h"

namespace stillmap::wire {

[[nodiscard]] dds::MapIdentity identity_of(const MapSnapshot& view);
[[nodiscard]] stillmap_msgs::msg::MapIdentity to_wire(const dds::MapIdentity& identity);
[[nodiscard]] dds::MapIdentity from_wire(const stillmap_msgs::msg::MapIdentity& identity);

[[nodiscard]] stillmap_msgs::msg::TileInfo to_wire(const TileInfo& info,
                                                   const dds::MapIdentity& identity);
/// Nothing for a format version that is not ours.
[[nodiscard]] std::optional<TileInfo> from_wire(const stillmap_msgs::msg::TileInfo& message);

[[nodiscard]] stillmap_msgs::msg::MapTile to_wire(const Tile& tile,
                                                  const dds::MapIdentity& identity);
/// Of a voxel's evidence it has only the winning class, its weight being the confidence, and no
/// times. Nothing for another format version, arrays of different lengths, sizes that no map has,
/// or voxels outside of any tile.
[[nodiscard]] std::optional<Tile> from_wire(const stillmap_msgs::msg::MapTile& message);

/// Gives all arrays this length.
void resize(stillmap_msgs::msg::Voxels& voxels, std::size_t count);

/// True when all arrays have one length and all classes exist.
[[nodiscard]] bool consistent(const stillmap_msgs::msg::Voxels& voxels);

}  // namespace stillmap::wire
