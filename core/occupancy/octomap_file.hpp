#pragma once

#include <filesystem>

#include "core/map/storage/map_file.hpp"
#include "core/occupancy/octomap_data.hpp"

namespace stillmap {

/// The encoding that the file's extension names: .bt binary, .ot full. Throws MapFileError for any
/// other.
[[nodiscard]] OctomapEncoding octomap_encoding_of(const std::filesystem::path& file);

/// Writes a file that octovis and other OctoMap programs open. An existing file is replaced
/// atomically. Throws MapFileError. @pre the extension matches data.encoding
void write_octomap_file(const std::filesystem::path& file, const OctomapData& data);

/// Reads and checks such a file. Throws MapFileError.
[[nodiscard]] OctomapData read_octomap_file(const std::filesystem::path& file);

}  // namespace stillmap
