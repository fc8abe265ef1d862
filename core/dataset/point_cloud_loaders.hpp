#pragma once

#include <filesystem>

namespace pcl {
struct PCLPointCloud2;
}

namespace stillmap {

// The raw fields of a cloud file. Both throw DatasetError.

/// Through PCL, which is handed a header written anew from what was checked: on damaged headers
/// its own reader crashes.
[[nodiscard]] pcl::PCLPointCloud2 load_pcd(const std::filesystem::path& file);

/// The vertices only. PCL's own PLY reader changes the types of fields, takes indices of grids
/// unchecked and crashes on damaged headers, so that it is not used.
[[nodiscard]] pcl::PCLPointCloud2 load_ply(const std::filesystem::path& file);

}  // namespace stillmap
