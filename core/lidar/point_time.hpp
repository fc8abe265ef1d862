#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace stillmap {

/// What a driver writes the time of a point in.
enum class TimeType { integer, float32, float64 };

/// Per-point times as `Scan::time_offset_s` has them, and how they were understood.
struct PointTimes {
  /// Seconds relative to the scan's stamp; not finite for points without a time of their own, and
  /// empty when the numbers cannot be times of one revolution.
  std::vector<float> offsets_s;
  /// For people: "ns from the stamp", "s since 1970", or why there are none.
  std::string remark;
};

/// Per-point times as drivers write them, brought to seconds relative to the scan's stamp.
///
/// Drivers write offsets (Velodyne, Ouster) or absolute times (Hesai, RoboSense, Livox), in s, ms,
/// us or ns. Whole numbers are nanoseconds and others seconds, unless a scan would then take less
/// than 1 ms or more than 5 s and another unit makes it a revolution (5 ms to 5 s). The points'
/// median decides what is meant: those more than 10 s from it have no time (drivers write 0 where
/// a packet was lost), and are not moved. Offsets within 10 s of zero are kept as they are. Larger
/// values are absolute: the offset is then the distance to `stamp_ns` where that is the same clock
/// (within 10 s), else to the earliest point. Absolute times in 32-bit floats are 128 s apart and
/// therefore none.
[[nodiscard]] PointTimes point_times(std::span<const double> times, TimeType type,
                                     std::int64_t stamp_ns);

}  // namespace stillmap
