#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/prepare.hpp"
#include "core/localization/localizer.hpp"

namespace stillmap {

/// What tells how the lidar moved within the sweep of a scan.
enum class SweepMotionSource : std::uint8_t {
  /// The points have no times: the scan is compensated already, or was measured at one instant.
  no_times,
  /// The scans before it (ScanFollower).
  scans_before,
  /// The map that it was found in.
  map,
  /// Nothing: the points are as they were measured.
  unknown,
};
/// "no times", "scans before", "map", "unknown".
[[nodiscard]] const char* name(SweepMotionSource source);

/// A sweep in a map.
struct SweepInMap {
  /// Motion of the lidar from its start to its end, and its pose in the middle.
  Eigen::Isometry3d T_start_end = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_map_middle = Eigen::Isometry3d::Identity();
  /// Both are known. Otherwise a half is not believed there, or the halves come to no steady
  /// motion: it is about as large.
  bool is_known = false;
};

/// The motion within a sweep, told by a map: what was measured in the first half of the sweep and
/// in the second one is registered each for itself, from a pose within a metre of that in the
/// middle, and the halves' poses are half a sweep apart.
[[nodiscard]] SweepInMap sweep_in_map(const Localizer& localizer, const Scan& scan,
                                      const PointLabels& labels, const SweepTimes& sweep,
                                      const Eigen::Matrix3d& R_body_lidar,
                                      const Eigen::Isometry3d& T_map_lidar);

/// Where a scan is in a map, and what told its motion.
struct StampedLocalization {
  LocalizationResult result;
  SweepMotionSource motion = SweepMotionSource::no_times;
};

/// Finds a prepared scan beside which there is no other one. Where its points have times, the pose
/// is that at its stamp, as far as the map tells the motion; where it does not, and the sweep was
/// bent, it is ambiguous. Throws what the localizer does.
[[nodiscard]] StampedLocalization localize_lone_scan(const Localizer& localizer, const Scan& scan,
                                                     const PointLabels& labels,
                                                     const Eigen::Matrix3d& R_body_lidar,
                                                     double period_s);

}  // namespace stillmap
