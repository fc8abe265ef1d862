#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/map/tile_evidence.hpp"

namespace stillmap {

/// The evidence as bytes, nothing lost: a version byte, then a zstd frame (with checksum) of i32 x,
/// i32 y, three u32 counts, and the three lists by byte planes. All little-endian.
[[nodiscard]] std::vector<std::uint8_t> encode_evidence(const TileEvidence& evidence);

/// Throws TileCodecError for whatever encode_evidence did not write; reads nothing beyond `bytes`.
[[nodiscard]] TileEvidence decode_evidence(std::span<const std::uint8_t> bytes);

}  // namespace stillmap
