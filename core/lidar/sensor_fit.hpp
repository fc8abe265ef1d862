#pragma once

#include <optional>
#include <string>

#include "core/lidar/scan.hpp"
#include "core/lidar/sensor_model.hpp"

namespace stillmap {

/// The sensor model that fits a scan: by the elevations of its rings where it has a
/// ring field, else by the share of the field of view that it fills. A built-in sensor (VLP-16,
/// HDL-32E, HDL-64E) where one fits within half a degree; else one made of the scan's own rings, or
/// without a ring field of 40 bands between its lowest and highest points, which takes lidars that
/// have no rings at all (Livox) as well as those that do not number them. Nothing when the
/// scan has too few points.
[[nodiscard]] std::optional<SensorModel> fit_sensor(const Scan& scan);

/// Why a scan cannot come from this sensor, in words: rings beyond the sensor's, or most points
/// outside its field of view. Empty when it can.
[[nodiscard]] std::string sensor_mismatch(const Scan& scan, const SensorModel& sensor);

}  // namespace stillmap
