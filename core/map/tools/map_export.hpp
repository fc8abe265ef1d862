#pragma once

#include <filesystem>

#include "core/map/tile.hpp"

namespace stillmap {

/// Writes a point for every voxel: position (map frame [m]), class, its colour and its share of the
/// evidence. Binary PCD or PLY. Throws DatasetError when the file cannot be written.
void export_pcd(const MapSnapshot& view, const std::filesystem::path& file);
void export_ply(const MapSnapshot& view, const std::filesystem::path& file);

}  // namespace stillmap
