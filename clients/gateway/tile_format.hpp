#pragma once

#include <string>

#include "core/map/tile.hpp"
#include "idl/interface/map_identity.hpp"

namespace stillmap::gateway {

/// A tile for the page, little-endian: the 32 bytes of the head, then 8 bytes for each voxel. Of
/// the same content as its content hash, so that a browser may keep it under that hash for ever.
///
///     char[4] "STL1"; int32 tile x, y; uint32 voxels; float32 tile size, voxel size [m],
///     lowest z [m]; uint32 0
///     per voxel uint16: x, y from the tile's corner, z from the lowest, in eighths of a voxel;
///     class
///
/// Voxels come in an order in which the first n of them are spread evenly over the tile: a coarser
/// picture is the beginning of the finer one. Heights of more than 8191 voxels above the lowest
/// are cut off.
[[nodiscard]] std::string encode_tile(const Tile& tile, const dds::MapIdentity& map);

}  // namespace stillmap::gateway
