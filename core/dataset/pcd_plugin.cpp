#include "core/dataset/pcd_plugin.hpp"

#include <pcl/PCLPointCloud2.h>
#include <pcl/console/print.h>
#include <pcl/io/pcd_io.h>

#include <sstream>

extern "C" bool stillmap_read_pcd(const std::string& header, const std::string& encoding,
                                  const std::string& body, pcl::PCLPointCloud2& cloud) {
  // What PCL would print on the console is in our exception.
  pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);
  pcl::PCDReader reader;
  std::istringstream header_stream(header);
  Eigen::Vector4f origin;
  Eigen::Quaternionf orientation;
  int version = 0, data_type = 0;
  unsigned int data_start = 0;
  if (reader.readHeader(header_stream, cloud, origin, orientation, version, data_type, data_start) <
      0) {
    return false;
  }
  if (encoding == "ascii") {
    std::istringstream body_stream(body);
    return reader.readBodyASCII(body_stream, cloud, version) >= 0;
  }
  return reader.readBodyBinary(reinterpret_cast<const unsigned char*>(body.data()), cloud, version,
                               encoding == "binary_compressed", 0) >= 0;
}

static_assert(std::is_same_v<decltype(stillmap_read_pcd), stillmap::ReadPcd>);
