#pragma once

#include <optional>

#include "core/odometry/pose_search.hpp"
#include "core/odometry/registration.hpp"

namespace stillmap {

/// Another pose of a map's second scan than `found`, which edges and planes of few rings have told:
/// where few of these were found in the first scan, and the points lie better where a coarse
/// registration has the lidar, or if it has not moved. `degenerate` then, or `lost` where no
/// features are found there; nothing where `found` may stay. On open land walls are farther off
/// than where rings are as close as neighbours must be, and what is found nevertheless is chance:
/// it tilts the scan, and the map with it.
[[nodiscard]] std::optional<OdometryResult> first_motion_by_points(const OdometryResult& found,
                                                                   const FeatureSets& features,
                                                                   const LocalMap& map,
                                                                   const RegisteredScan& last,
                                                                   const OdometryConfig& config);

}  // namespace stillmap
