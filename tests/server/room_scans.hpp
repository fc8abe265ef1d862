#pragma once

#include "core/lidar/scan.hpp"
#include "core/lidar/trajectory.hpp"

namespace stillmap::test {

/// True pose of the lidar at scan `index` of a slow drive through a hall with pillars.
[[nodiscard]] StampedPose room_pose(int index);

/// What a 16-beam lidar sees there, `columns` times a turn: ground (road), walls (building),
/// pillars (pole).
[[nodiscard]] Scan room_scan(int index, int columns = 720);

/// The same from any pose in the hall.
[[nodiscard]] Scan seen_in_room(const StampedPose& pose, int columns = 720);

}  // namespace stillmap::test
