#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "core/lidar/scan.hpp"

namespace stillmap {

struct PrepareConfig {
  double min_range_m = 0.5;
  double max_range_m = 120.0;
  /// Points inside this box belong to the robot itself; empty by default. Lidar frame [m].
  Eigen::AlignedBox3d ego_hull_lidar;
  /// Undo the motion during the revolution when points carry their time.
  bool deskew = true;
};

/// Indices of the points that drop_unusable_points() keeps, in the scan's order.
[[nodiscard]] std::vector<std::uint32_t> usable_points(const Scan& scan,
                                                       const PrepareConfig& config);

/// The scan without points that are not finite, too near, too far or on the robot itself. All
/// per-point vectors stay aligned.
[[nodiscard]] Scan drop_unusable_points(Scan scan, const PrepareConfig& config);

/// Turns every point up by this angle [rad], about the horizontal axis across its direction: what
/// SensorModel::elevation_offset asks for.
void turn_up(Scan& scan, double angle_rad);

/// When a sweep was measured, relative to the scan's stamp [s].
struct SweepTimes {
  double middle_s = 0.0;
  /// From the first point to the last; 0: all at one instant (within 2 ms), or no usable times.
  double duration_s = 0.0;

  /// -0.5 at the start of the sweep, 0.5 at its end; 0 for a time that cannot be of this sweep.
  [[nodiscard]] double part(float time_offset_s) const;
};

/// From the points' times, whatever instant the stamp is.
[[nodiscard]] SweepTimes sweep_times(const Scan& scan, double period_s);

/// Moves every point to the middle of the sweep. The lidar is taken to move steadily;
/// `T_start_end` is its motion during the whole sweep. Keeps the points' times.
void deskew_to_middle(Scan& scan, const SweepTimes& sweep, const Eigen::Isometry3d& T_start_end);

/// The scan as if taken in one instant, at `stamp_ns` (paper II-A, "jelly effect"). The lidar is
/// taken to move steadily; `T_start_end` is its motion during `period_s`. Clears `time_offset_s`.
/// A scan without times comes back as it is.
[[nodiscard]] Scan deskew(Scan scan, const Eigen::Isometry3d& T_start_end, double period_s);

}  // namespace stillmap
