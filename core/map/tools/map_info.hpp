#pragma once

#include <Eigen/Geometry>
#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <string>

#include "core/lidar/semantic_class.hpp"
#include "core/map/storage/map_file.hpp"

namespace stillmap {

/// A stretch of time, nanoseconds since the Unix epoch; 0, 0 for none.
struct TimeSpan {
  std::int64_t first_ns = 0;
  std::int64_t last_ns = 0;
};

/// Figures of a map.
struct MapInfo {
  std::uint64_t map_id = 0;
  std::uint64_t version = 0;
  double tile_size_m = 0.0;
  double voxel_size_m = 0.0;
  std::uint64_t tiles = 0;
  std::uint64_t voxels = 0;
  /// Points that were seen in the voxels.
  std::uint64_t points = 0;
  std::array<std::uint64_t, semantic_class_count> voxels_of_class{};
  /// Smallest box around the means of the voxels, map frame [m]; empty without voxels.
  Eigen::AlignedBox3d bounds_map;
  TimeSpan observation_span;
  std::uint64_t poses = 0;
  double path_length_m = 0.0;
  TimeSpan trajectory_span;
  std::map<std::string, std::string> metadata;
};

[[nodiscard]] MapInfo describe_map(const SavedMap& map);

/// A map file and what it holds.
struct MapFileInfo {
  MapInfo map;
  /// The file alone; a log beside it not counted.
  std::uint64_t bytes = 0;
  std::uint32_t schema_version = 0;
};

/// The file stays as it is. Throws MapFileError.
[[nodiscard]] MapFileInfo map_file_info(const std::filesystem::path& file);

}  // namespace stillmap
