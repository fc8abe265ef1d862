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

/// Result of a check.
struct MapCheck {
  std::size_t tiles = 0;
  std::uint64_t voxels = 0;
  /// Voxels that are known and not shown.
  std::uint64_t hidden_voxels = 0;
  std::size_t poses = 0;
  /// Those that the path is of, as `read_map_sessions` lists them.
  std::size_t sessions = 0;
  /// Tiles that a server could still serve.
  std::size_t sound_tiles = 0;
  std::vector<MapFault> faults;

  [[nodiscard]] bool is_sound() const { return faults.empty(); }
};

/// Called after every tile; `total` tiles are in the file.
using CheckProgress = std::function<void(std::size_t done, std::size_t total)>;

/// Reads all of a map file, which stays as it is, and finds every fault: SQLite's own structure,
/// each tile (decodes, agrees with its content hash and its row, voxels lie in their cells), sizes,
/// revisions, poses finite and rigid. Throws MapFileError for a file that is not a map of a known
/// version: missing, empty, a folder, of another program, of a newer version.
[[nodiscard]] MapCheck check_map_file(const std::filesystem::path& file,
                                      const CheckProgress& progress = {});

}  // namespace stillmap
