#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace stillmap {

/// Per-point times as drivers write them, brought to `Scan::time_offset_s`: seconds relative to
/// the scan's stamp.
///
/// Drivers write offsets (Velodyne, Ouster) or absolute times (Hesai, RoboSense, Livox). Offsets
/// within 10 s of zero are kept as they are. Larger values are absolute: the offset is then the
/// distance to `stamp_ns` where that is the same clock (all within 10 s), else to the earliest
/// point. Values that are not finite stay so, and such points are not moved.
[[nodiscard]] std::vector<float> time_offsets_from_seconds(std::span<const double> times_s,
                                                           std::int64_t stamp_ns);

}  // namespace stillmap
