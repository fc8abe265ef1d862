#pragma once

#include <filesystem>

#include "core/traversability/occupancy_grid.hpp"

namespace stillmap {

/// Writes the files that Nav2's map_server loads: `folder`/map.yaml and map.pgm, in trinary mode.
/// Lethal cells are black, free ones white, unknown ones grey. Inscribed cells (99) are free:
/// Nav2's inflation layer adds its own, for its own footprint. Costs do not fit into three values
/// and are lost. Throws std::runtime_error naming the file that cannot be written,
/// std::invalid_argument for a grid whose status is not ok.
void write_nav2_map(const std::filesystem::path& folder, const OccupancyGrid& grid);

}  // namespace stillmap
