#pragma once

#include <cstdint>
#include <filesystem>
#include <span>

#include "core/lidar/scan.hpp"

namespace stillmap {

/// The values of a point in a .bin file, each a float32. Nothing in the file says them.
enum class BinLayout : std::uint8_t {
  /// KITTI's and MulRan's: x, y, z, intensity.
  kitti,
  /// nuScenes': x, y, z, intensity (0..255), ring.
  nuscenes,
};

/// Tells the layout of a recording's .bin files by how their numbers repeat: KITTI's, unless
/// another one fits clearly better. Throws DatasetError, with the way out, where that is none of
/// the above: KITTI's points would be noise. Files that cannot be read say nothing.
[[nodiscard]] BinLayout bin_layout_of(std::span<const std::filesystem::path> files);

/// Intensity as the file has it. Points are taken as they are, finite or not; an empty file is an
/// empty scan. Throws DatasetError.
[[nodiscard]] Scan read_bin(const std::filesystem::path& file, BinLayout layout);

}  // namespace stillmap
