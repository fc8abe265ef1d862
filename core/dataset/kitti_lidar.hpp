#pragma once

#include <optional>
#include <span>
#include <string>

#include "core/lidar/scan.hpp"

namespace stillmap {

/// What the files of KITTI's lidar, an HDL-64E, do not say and users correct: its vertical angles
/// are off (KISS-ICP, CT-ICP and others turn every point up by 0.205 degrees), and scans of "KITTI
/// raw" were measured during a turn of the lidar, those of "KITTI odometry" are compensated for it.
struct KittiLidar {
  /// Duration of the sweep that the points were measured in, one after the other; 0 where they are
  /// compensated [s].
  double sweep_duration_s = 0.0;

  /// Turns the points up, and gives them the times of a sweep that falls in azimuth from one end
  /// behind the car to the other and faces forward at the stamp. Both leave order and range alone.
  void correct(Scan& scan) const;

  /// What correct() does, for those who did not ask for it.
  [[nodiscard]] std::string in_words() const;
};

/// How azimuths step along the rings, where the range jumps: a lidar measures at even steps;
/// compensation for the motion during the sweep moves what is near by more than what is far.
struct AzimuthSteps {
  /// Median difference from the usual step [rad].
  double deviation_at_jumps = 0.0;
  /// Way straight ahead during a sweep that the points were compensated for, as these steps show
  /// it, for a lidar whose azimuth falls with time and whose sweep begins at the rear [m].
  double compensated_m = 0.0;
};

/// Nothing where the scan has too few jumps in range.
[[nodiscard]] std::optional<AzimuthSteps> azimuth_steps(const Scan& scan);

/// Recognises KITTI's lidar by the unevenness of its beams, which no other one shares, from scans
/// taken all over a recording. Nothing for any other lidar, real or simulated.
/// `period_s` is the time between scans. Where `may_be_corrected`, as of all files but KITTI's own,
/// nothing for scans whose points have been turned up before, as those of a replay.
[[nodiscard]] std::optional<KittiLidar> recognise_kitti_lidar(std::span<const Scan> scans,
                                                              double period_s,
                                                              bool may_be_corrected);

}  // namespace stillmap
