#pragma once

#include <memory>
#include <optional>
#include <string>

#include "core/lidar/scan.hpp"
#include "core/lidar/sensor_model.hpp"

namespace stillmap {

/// The sensor model that fits a scan: by the elevations of its rings, which a field numbers (unless
/// a quarter of the points lie far from where it says), which nearly all points lie close to, or
/// which it stores one after the other, from the highest; else by the field of view that it fills.
/// A built-in sensor (VLP-16, HDL-32E, HDL-64E) where one fits within half a degree, though a
/// quarter of its rings saw nothing, as those that look into the sky; else one made of the scan's
/// own rings, or where it shows none (Livox, points moved to one time) of 40 bands between its
/// lowest and highest points. Nothing when the scan has too few points.
[[nodiscard]] std::optional<SensorModel> fit_sensor(const Scan& scan);

/// Why a scan cannot come from this sensor, in words: rings beyond the sensor's, or most points
/// outside its field of view. Empty when it can.
[[nodiscard]] std::string sensor_mismatch(const Scan& scan, const SensorModel& sensor);

/// "VLP-16: 16 rings from 15.00 to -15.00 degrees of elevation".
[[nodiscard]] std::string in_words(const SensorModel& sensor);

/// Finds out from scans, one after another, which lidar they come from.
class SensorRecognition {
 public:
  /// Takes a scan. True where it tells the lidar: the first one of enough points (fit_sensor) does,
  /// and a later one that shows more rings, or without rings a wider field of view.
  [[nodiscard]] bool learn(const Scan& scan);
  /// Null until it is told.
  [[nodiscard]] const std::shared_ptr<const SensorModel>& sensor() const { return sensor_; }

 private:
  std::shared_ptr<const SensorModel> sensor_;
  int times_told_ = 0;
};

}  // namespace stillmap
