#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/lidar/scan.hpp"
#include "core/lidar/sensor_model.hpp"

namespace stillmap {

/// The beam of every point, 0 = highest and below `sensor.rings`.
///
/// From the scan's ring field when it has one (reversed when its numbers rise from the bottom, as
/// Velodyne's drivers count, and whichever numbers it uses: RingNumbering), else as
/// `sensor.ring_source` says. A field that cannot be this sensor's, and an order that is not ring
/// after ring, fall back to the elevation. Points between or outside the beams get the nearest one;
/// points that are not finite get ring 0.
[[nodiscard]] std::vector<std::uint16_t> assign_rings(const Scan& scan, const SensorModel& sensor);

/// The nearest beam of every point by its elevation alone.
[[nodiscard]] std::vector<std::uint16_t> rings_from_elevation(const Scan& scan,
                                                              const SensorModel& sensor);

/// The ring of every point of a scan that is stored ring after ring from the highest, each ring
/// once round from +x or from -x, in either sense, as in KITTI's .bin files. Empty when the scan
/// is not stored like that.
[[nodiscard]] std::vector<std::uint16_t> rings_from_order(const Scan& scan,
                                                          const SensorModel& sensor);

/// How often the azimuth has gone round at each point, as the scan is stored: the rings of a scan
/// that is stored ring after ring, each once round from +x (the first), or from -x (the second).
/// Points without an azimuth belong to the turn of those before them.
[[nodiscard]] std::array<std::vector<std::uint16_t>, 2> turns_in_order(const Scan& scan);

}  // namespace stillmap
