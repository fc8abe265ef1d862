#include "idl/conversions/cloud_reader.hpp"

#include <utility>

namespace stillmap::wire {

CloudReader::CloudReader(const CloudReadOptions& options)
    : options_(options), intensity_scale_(options.intensity_scale) {
  // The scale is applied here.
  options_.intensity_scale = 1.0F;
}

CloudReader::Result CloudReader::read(const sensor_msgs::msg::PointCloud2& cloud) {
  Result result{.from_cloud = to_scan(cloud, options_), .format_change = {}};
  if (!result.from_cloud.scan) return result;
  const std::string corrected = intensity_scale_.apply(result.from_cloud.scan->intensity);
  const std::string& format = result.from_cloud.format;
  if (format != format_) result.format_change = format_ = format;
  if (!corrected.empty()) {
    result.format_change.append(result.format_change.empty() ? "" : "; ").append(corrected);
  }
  return result;
}

}  // namespace stillmap::wire
