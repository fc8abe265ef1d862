#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/map/storage/byte_planes.hpp"

namespace stillmap {

/// A version byte, then a zstd frame with checksum: how everything of a tile is stored.
/// Throws TileCodecError for content beyond 256 MiB.
[[nodiscard]] std::vector<std::uint8_t> to_frame(std::uint8_t format_version,
                                                 const PlaneBytes& content);

/// The content again. Throws TileCodecError for a version that this program does not read, for what
/// is no such frame or is damaged, and for less than `min_bytes` of content.
[[nodiscard]] std::vector<std::uint8_t> from_frame(std::span<const std::uint8_t> frame,
                                                   std::size_t min_bytes);

}  // namespace stillmap
