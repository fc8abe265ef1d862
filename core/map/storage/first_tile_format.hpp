#pragma once

#include <cstdint>
#include <span>

#include "core/map/tile.hpp"
#include "core/map/tile_evidence.hpp"

/// Tiles and evidence as the first format stores them: every field of a voxel as it was in memory,
/// means and weights as floats. They are read, and never written.
namespace stillmap::first_tile_format {

inline constexpr std::uint8_t format_version = 1;

/// Throw TileCodecError for whatever is no such frame, and for voxels whose mean is not in their
/// cell. What a client sees, the content hash with it, stays; means and weights are rounded.
[[nodiscard]] Tile decode_tile(std::span<const std::uint8_t> frame, const VoxelGrid& grid);
[[nodiscard]] TileEvidence decode_evidence(std::span<const std::uint8_t> frame,
                                           const VoxelGrid& grid);

}  // namespace stillmap::first_tile_format
