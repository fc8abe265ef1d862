#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>

#include "core/dataset/dataset_frame.hpp"
#include "core/lidar/sensor_model.hpp"

namespace stillmap {

/// Scans from somewhere else than files of one scan each, as from a bag. Thread-safe as far as its
/// callers need: one thread reads.
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
  /// When the recording says which it was.
  [[nodiscard]] virtual std::optional<SensorModel> sensor() const = 0;
};

}  // namespace stillmap
