#include "idl/conversions/cloud_reader.hpp"

#include <utility>

namespace stillmap::wire {

CloudReader::CloudReader(const CloudReading& reading)
    : reading_(reading), intensity_scale_(reading.intensity_scale) {
  // The scale is applied here.
  reading_.intensity_scale = 1.0F;
}

CloudReader::Result CloudReader::read(const sensor_msgs::msg::PointCloud2& cloud) {
  Result result{.from_cloud = to_scan(cloud, reading_), .news = {}};
  if (!result.from_cloud.scan) return result;
  const std::string corrected = intensity_scale_.apply(result.from_cloud.scan->intensity);
  const std::string& understood = result.from_cloud.understood;
  if (understood != understood_) result.news = understood_ = understood;
  if (!corrected.empty()) {
    result.news.append(result.news.empty() ? "" : "; ").append(corrected);
  }
  return result;
}

}  // namespace stillmap::wire
