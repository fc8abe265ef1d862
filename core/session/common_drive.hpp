#pragma once

#include "core/lidar/trajectory.hpp"

namespace stillmap {

/// Whether two paths are of one drive as far as both go: one is an earlier state of the other, or
/// they are the same. Their stamps may differ by an offset, and loop closures may have moved the
/// poses of one since. Stamps alone tell nothing, since those of simulated drives are alike: how
/// the motion jumps from scan to scan is the odometry's error, and the same in no two drives. False
/// for paths of fewer than eight poses, and for a lidar that stands and has no error.
[[nodiscard]] bool are_of_one_drive(const Trajectory& a, const Trajectory& b);

}  // namespace stillmap
