#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>

#include "core/lidar/scan.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/odometry/odometry.hpp"

namespace stillmap {

/// Makes single scans of a recording as if measured at their stamps: a short odometry of the scans
/// before each tells how the lidar moved in its sweep.
class ScanFollower {
 public:
  /// A scan of the recording, prepared, with its times, and with rings where uses_rings(); nothing
  /// where it cannot be read.
  using Read = std::function<std::optional<Scan>(std::size_t index)>;

  ScanFollower(const OdometryConfig& odometry, const SensorModel& sensor, Read read);

  /// Whether scans need their rings (see assign_rings).
  [[nodiscard]] bool uses_rings() const { return odometry_.uses_rings(); }

  /// `scan`, which is what `read(index)` gives, without times; nothing where it has none, or where
  /// the scans before it do not tell its motion. Costs the odometry of one scan where the one
  /// before it was asked for last, else of four.
  [[nodiscard]] std::optional<Scan> at_stamp(std::size_t index, const Scan& scan);

 private:
  void begin();
  /// The scan at its stamp; nothing where its motion since the last one cannot be told.
  std::optional<Scan> follow(Scan scan);

  SensorModel sensor_;
  Read read_;
  Odometry odometry_;
  /// Scans in a row that were followed, and the last one's number and stamp.
  int followed_ = 0;
  std::size_t last_index_ = 0;
  std::int64_t last_stamp_ns_ = 0;
};

}  // namespace stillmap
