#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/map/tile.hpp"

namespace stillmap {

/// One thing that is wrong with a map file.
struct MapFault {
  /// "file", "map", "tile", "trajectory".
  std::string place;
  /// Of a tile's fault.
  std::optional<TileId> tile;
  std::string what;
};

/// What a check looked at, and what it found.
struct MapCheck {
  std::size_t tiles = 0;
  std::uint64_t voxels = 0;
  /// Places that are known and not shown.
  std::uint64_t hidden_voxels = 0;
  std::size_t poses = 0;
  /// Tiles that a server could still serve.
  std::size_t sound_tiles = 0;
  std::vector<MapFault> faults;

  [[nodiscard]] bool is_sound() const { return faults.empty(); }
};

/// Called after every tile; `total` tiles are in the file.
using CheckProgress = std::function<void(std::size_t done, std::size_t total)>;

/// Reads all of a map file, which stays as it is, and finds every fault: SQLite's own structure,
/// each tile (decodes, agrees with its content hash and its row, voxels lie in their cells), sizes,
/// revisions, poses in order of time, finite and rigid. Throws MapFileError for what is no map file
/// that this program knows: missing, empty, a folder, another program's, of a newer version.
[[nodiscard]] MapCheck check_map_file(const std::filesystem::path& file,
                                      const CheckProgress& progress = {});

}  // namespace stillmap
