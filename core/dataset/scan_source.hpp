#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/geodesy/gnss_fix.hpp"
#include "core/inertial/imu_sample.hpp"
#include "core/lidar/scan.hpp"
#include "core/lidar/sensor_model.hpp"

namespace stillmap {

/// One scan of a dataset and its ground truth.
struct DatasetFrame {
  /// With the labels reduced to the network's classes, where the dataset has labels.
  Scan scan;
  /// Original SemanticKITTI labels: moving ids in the low, instances in the high 16 bits. Truth for
  /// evaluation only. Empty without labels. From a ScanSource: as the source has them.
  std::vector<std::uint32_t> raw_labels;
  /// How the fields of its points were understood, for people: "intensity from i (uint8), no time,
  /// no ring". Empty where the format itself says it.
  std::string format;
};

/// Scans that do not come from files of one scan each, such as those of a bag. Read by one
/// thread at a time.
class ScanSource {
 public:
  ScanSource() = default;
  virtual ~ScanSource() = default;
  ScanSource(const ScanSource&) = delete;
  ScanSource& operator=(const ScanSource&) = delete;

  [[nodiscard]] virtual std::size_t size() const = 0;
  /// What messages call scan `i`; its file() in a ScanDataset.
  [[nodiscard]] virtual std::filesystem::path name(std::size_t i) const = 0;
  [[nodiscard]] virtual std::int64_t stamp_ns(std::size_t i) const = 0;
  /// Intensity in the sensor's own numbers. Throws DatasetError when the scan is damaged; the
  /// others can still be read.
  [[nodiscard]] virtual DatasetFrame read(std::size_t i) const = 0;
  /// Nothing where the source does not tell which sensor it was.
  [[nodiscard]] virtual std::optional<SensorModel> sensor() const = 0;
  /// Whether all scans are of one frame, so that parts of a turn may be joined.
  [[nodiscard]] virtual bool is_of_one_frame() const { return true; }
  /// Samples of the IMU that was recorded beside the scans, in the order of the recording; empty
  /// without one.
  [[nodiscard]] virtual std::vector<ImuSample> imu() const { return {}; }
  /// The same of a GNSS receiver.
  [[nodiscard]] virtual std::vector<GnssFix> gnss() const { return {}; }
};

}  // namespace stillmap
