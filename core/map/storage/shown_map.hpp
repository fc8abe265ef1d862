#pragma once

#include "core/map/storage/map_file.hpp"
#include "core/map/storage/map_file_copy.hpp"

namespace stillmap {

/// What a map file shows, with its trajectory and metadata, but without the tiles' evidence, which
/// is the larger half: for readers of voxels. Throws MapFileError, which names the copied file.
[[nodiscard]] SavedMap read_shown_map(const MapFileCopy& copy);

}  // namespace stillmap
