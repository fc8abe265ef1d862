#pragma once

#include "core/lidar/scan.hpp"
#include "core/lidar/trajectory.hpp"

namespace stillmap::test {

/// True pose of the lidar at scan `index` of a slow drive to and fro in a hall with pillars.
[[nodiscard]] StampedPose room_pose(int index);

/// What a 16-beam lidar sees there: ground (road), walls (building), pillars (pole).
[[nodiscard]] Scan room_scan(int index);

/// The same from any pose in the hall.
[[nodiscard]] Scan seen_in_room(const StampedPose& pose);

}  // namespace stillmap::test
