#pragma once

#include <optional>
#include <string>
#include <vector>

#include "core/lidar/label_kind.hpp"
#include "core/lidar/point_fields.hpp"
#include "core/lidar/scan.hpp"
#include "idl/msg/wire_types.hpp"

namespace stillmap::wire {

/// How the fields of incoming clouds are to be understood.
struct CloudReadOptions {
  PointFieldNames fields;
  /// Brings the sensor's intensity to 0..1.
  float intensity_scale = 1.0F;
  /// The label field holds classes 0..19; otherwise original SemanticKITTI ids, of which only the
  /// class is kept (moving-car becomes car). Then a field of 8 bits is something else: it is left
  /// out, as one of floats that are not all whole numbers always is.
  bool labels_are_classes = false;
  /// The labels as they are in the field are wanted, too.
  bool keeps_raw_labels = false;
};

/// Why a cloud cannot be used.
struct CloudFault {
  /// One word for a counter: "size_mismatch".
  std::string counter;
  /// With the field and its value.
  std::string reason;
};

/// Either a scan or a fault.
struct ScanFromCloud {
  std::optional<Scan> scan;
  CloudFault fault;
  /// How the cloud was understood, for people: "intensity from reflectivity (uint16), time from t
  /// (uint32: ns from the stamp), ring from ring (uint8)", and where there is a label field what it
  /// is taken for: "label from label (uint8: ignored)".
  std::string format;
  /// Of labels that were read as SemanticKITTI ids; else none.
  LabelCensus label_census = {};
  /// Numbers of the label field, where it is used and they are wanted; else empty.
  std::vector<std::uint32_t> raw_labels = {};
};

/// Reads a cloud of any field types and byte order; any input is fine. Points that are not finite
/// stay in. Times of any unit, relative or absolute: see point_times().
[[nodiscard]] ScanFromCloud to_scan(const sensor_msgs::msg::PointCloud2& cloud,
                                    const CloudReadOptions& options);

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
