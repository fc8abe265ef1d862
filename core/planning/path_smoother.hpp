#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/planning/collision_checker.hpp"

namespace stillmap {

/// The poses of a path along the curves between waypoints, the first one included; nothing when
/// one of the curves is not free. @pre there is a waypoint
[[nodiscard]] std::optional<std::vector<PathPoint>> connect_waypoints(
    const CollisionChecker& checker, std::span<const PlanarPose> waypoints);

/// Takes detours and wiggles out of a path, and moves it to where it costs less: curves between two
/// of its poses, straight or by a pose near the path, that are free and cost less than what lies
/// between replace it. The path may end in any of `ends` instead of its last pose. `should_stop`
/// may be empty.
[[nodiscard]] std::vector<PathPoint> smooth_path(const CollisionChecker& checker,
                                                 std::vector<PathPoint> path,
                                                 std::span<const PlanarPose> ends, int tries,
                                                 std::uint32_t seed,
                                                 const std::function<bool()>& should_stop);

/// Fewer poses of the same path: about `spacing_m` apart, with those where it turns back.
[[nodiscard]] std::vector<PathPoint> downsampled(std::span<const PathPoint> path, double spacing_m);

}  // namespace stillmap
