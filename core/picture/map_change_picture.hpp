#pragma once

#include <filesystem>
#include <vector>

#include "core/map/tile.hpp"
#include "core/map/tools/map_diff.hpp"

namespace stillmap {

/// Writes a PNG of both maps from above, x to the right and y up: grey what stayed, green what
/// appeared, red what is gone, yellow what is of another class; scale bar and legend. Throws
/// std::runtime_error naming the file when it cannot be written.
void write_diff_picture(const std::filesystem::path& file, const MapSnapshot& before,
                        const MapSnapshot& after, const MapDiff& diff, int max_side_px = 1800);

/// Writes a PNG of the map from above in grey, and over it what was removed, coloured by reason,
/// with a legend that counts. Throws std::runtime_error naming the file when it cannot be written.
void write_removed_picture(const std::filesystem::path& file, const MapSnapshot& view,
                           const std::vector<RemovedVoxel>& removed, int max_side_px = 1800);

}  // namespace stillmap
