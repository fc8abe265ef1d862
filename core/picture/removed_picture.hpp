#pragma once

#include <filesystem>
#include <string_view>
#include <vector>

#include "core/map/tile.hpp"

namespace stillmap {

/// In words, as on the picture.
[[nodiscard]] std::string_view name(RemovalReason reason);

/// Writes a PNG of the map from above in grey, and over it what was removed, coloured by reason,
/// with a legend that counts. Throws std::runtime_error naming the file when it cannot be written.
void write_removed_picture(const std::filesystem::path& file, const MapSnapshot& view,
                           const std::vector<RemovedVoxel>& removed, int max_side_px = 1800);

}  // namespace stillmap
