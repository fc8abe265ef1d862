#pragma once

#include <string>

namespace pcl {
struct PCLPointCloud2;
}

namespace stillmap {

/// The optional part "pcd": PCL's reader over a header and a body that were checked, in memory.
/// `encoding` is the header's. False when PCL is not content; may throw what PCL throws.
using ReadPcd = bool(const std::string& header, const std::string& encoding,
                     const std::string& body, pcl::PCLPointCloud2& cloud);
inline constexpr const char* read_pcd_name = "stillmap_read_pcd";

}  // namespace stillmap
