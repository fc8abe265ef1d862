#pragma once

#include "core/map/storage/map_file.hpp"

namespace stillmap::fuzz {

/// A map of four small tiles with ground, a wall, a pole and something that was taken out; with the
/// evidence of its tiles, a few poses and metadata. Small, for it is mutated and loaded again and
/// again.
[[nodiscard]] SavedMap small_street();

/// The sizes of its tiles and voxels.
[[nodiscard]] StaticMapConfig street_config();

}  // namespace stillmap::fuzz
