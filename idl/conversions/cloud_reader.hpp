#pragma once

#include <string>

#include "core/lidar/point_fields.hpp"
#include "idl/conversions/cloud_to_scan.hpp"

namespace stillmap::wire {

/// Reads the clouds of one sensor, one after another, and finds out what its numbers mean where the
/// description of the sensor does not fit. One thread uses it.
class CloudReader {
 public:
  explicit CloudReader(const CloudReadOptions& options);

  struct Result {
    ScanFromCloud from_cloud;
    /// How clouds are understood from this one on, when that changed; else empty.
    std::string format_change;
  };
  /// Intensity comes as 0..1. Any input is fine.
  [[nodiscard]] Result read(const sensor_msgs::msg::PointCloud2& cloud);

 private:
  CloudReadOptions options_;
  IntensityScale intensity_scale_;
  std::string format_;
};

}  // namespace stillmap::wire
