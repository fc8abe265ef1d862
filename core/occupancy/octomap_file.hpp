#pragma once

#include <filesystem>

#include "core/map/storage/map_file.hpp"
#include "core/occupancy/octomap_data.hpp"

namespace stillmap {

/// Whether the file's name asks for the binary kind (.bt) or the full one (.ot). Throws
/// MapFileError for another ending.
[[nodiscard]] bool is_binary_octomap(const std::filesystem::path& file);

/// Writes a file that octovis and every other OctoMap program opens; the kind must fit the name's
/// ending. What stood there before is replaced in one step. Throws MapFileError.
void write_octomap_file(const std::filesystem::path& file, const OctomapData& data);

/// Reads such a file and checks every byte. Throws MapFileError.
[[nodiscard]] OctomapData read_octomap_file(const std::filesystem::path& file);

}  // namespace stillmap
