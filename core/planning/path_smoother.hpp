#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "core/planning/collision_checker.hpp"

namespace stillmap {

/// The poses along the curves between waypoints, including the first; nothing if one of the curves
/// is not free. @pre !waypoints.empty()
[[nodiscard]] std::optional<std::vector<PathPoint>> connect_waypoints(
    const CollisionChecker& checker, std::span<const PlanarPose> waypoints);

/// Shortens a path by random shortcuts: a free curve between two of its poses, direct or via a pose
/// near the path, replaces the part between them if it costs less. The path may end in any of
/// `ends` instead of its last pose. `should_stop` may be empty.
[[nodiscard]] std::vector<PathPoint> smooth_path(const CollisionChecker& checker,
                                                 std::vector<PathPoint> path,
                                                 std::span<const PlanarPose> ends, int attempts,
                                                 std::uint32_t seed,
                                                 const std::function<bool()>& should_stop);

/// The path with poses about `spacing_m` apart, including those at which it reverses.
[[nodiscard]] std::vector<PathPoint> downsampled(std::span<const PathPoint> path, double spacing_m);

}  // namespace stillmap
