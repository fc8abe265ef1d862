#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <vector>

#include "core/map/tile.hpp"
#include "core/map/tile_evidence.hpp"

namespace stillmap {

/// A tile that cannot be encoded, or bytes that are no tile; the text says what is wrong.
class TileCodecError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// The grid of a stored map; throws TileCodecError for sizes that no map has.
[[nodiscard]] VoxelGrid stored_grid(double voxel_size_m, double tile_size_m);

/// The formats that are read. No bit that turns makes one of another: a frame's checksum does not
/// cover its number.
inline constexpr std::array<std::uint8_t, 4> tile_formats = {1, 2, 4, 8};
/// The format that is written. The last one is the same, and of voxels that one beam alone hit
/// something thin in, it says so: only evidence that has any is written in it, as programs that do
/// not know it refuse it.
inline constexpr std::uint8_t tile_format = 4;
inline constexpr std::uint8_t thin_evidence_format = tile_formats.back();

/// A tile as bytes, nothing lost: a version byte, then a zstd frame (with checksum) of
///   i32 x, i32 y, u64 revision, u64 content_hash, u32 voxel count, f64 voxel size [m], u16 voxels
///   to a side, u32 stamp count,
///   the stamps of its voxels, ascending, by their differences,
///   and the voxels, both by byte planes: the first byte of all, the second byte of all, and so on,
///   which compresses better than one after the other. The votes for a voxel's first candidate
///   class are stored as what all its votes lack to one confident vote for each point.
/// All little-endian. Bounds are not stored, they follow from the voxels.
[[nodiscard]] std::vector<std::uint8_t> encode_tile(const Tile& tile);

/// Throws TileCodecError for whatever encode_tile did not write, and for voxels of other sizes than
/// the map's; reads nothing beyond `bytes`.
[[nodiscard]] Tile decode_tile(std::span<const std::uint8_t> bytes, const VoxelGrid& grid);

/// The evidence as bytes, nothing lost: a version byte, then a zstd frame (with checksum) of i32 x,
/// i32 y, the voxels' sizes, five u32 counts, and the three lists by byte planes, the last two
/// behind their stamps. All little-endian.
[[nodiscard]] std::vector<std::uint8_t> encode_evidence(const TileEvidence& evidence);

/// Throws TileCodecError for whatever encode_evidence did not write; reads nothing beyond `bytes`.
[[nodiscard]] TileEvidence decode_evidence(std::span<const std::uint8_t> bytes,
                                           const VoxelGrid& grid);

}  // namespace stillmap
