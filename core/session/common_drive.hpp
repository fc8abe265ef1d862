#pragma once

#include <cstddef>
#include <optional>

#include "core/lidar/trajectory.hpp"

namespace stillmap {

/// The same poses of the same drive in two paths.
struct CommonStretch {
  std::size_t first_a = 0;
  std::size_t first_b = 0;
  std::size_t poses = 0;
};

/// A stretch of one drive that two paths have in common, wherever it lies in them; nothing where
/// there is none of eight poses or more. Their stamps may differ by an offset, and loop closures
/// may have moved the poses of one since. Stamps alone tell nothing, since those of simulated
/// drives are alike: how the motion jumps from scan to scan is the odometry's error, and the same
/// in no two drives. Paths whose stamps go on alike beyond the stretch need more of it, up to some
/// forty poses. Nothing for a lidar that stands and has no error.
[[nodiscard]] std::optional<CommonStretch> common_stretch(const Trajectory& a, const Trajectory& b);

}  // namespace stillmap
