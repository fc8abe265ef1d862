#pragma once

#include <string>
#include <vector>

#include "core/map/query/map_query.hpp"

namespace stillmap::cli {

/// Whether write_cloud takes a file of this name.
[[nodiscard]] bool is_cloud_file(const std::string& file);

/// Writes a point for every voxel, with its class and colour, as the name ends: .pcd or .ply.
/// Throws DatasetError.
void write_cloud(const std::string& file, const std::vector<QueryVoxel>& voxels);

}  // namespace stillmap::cli
