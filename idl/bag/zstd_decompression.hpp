#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

namespace stillmap::dds {

/// Whether bytes begin as a zstd frame does, and as no serialized message can.
[[nodiscard]] bool is_zstd(std::span<const std::uint8_t> bytes);

/// What is in one zstd frame. Throws CdrError for bytes that are no whole frame, or hold more than
/// a message can (1 GiB).
[[nodiscard]] std::vector<std::uint8_t> decompressed(std::span<const std::uint8_t> frame);

/// Unpacks a file, piece by piece. Throws DatasetError for a damaged file, or when `to` cannot be
/// written.
void decompress_file(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace stillmap::dds
