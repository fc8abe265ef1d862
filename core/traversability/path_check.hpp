#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// The first collision along a path.
struct PathConflict {
  /// Index of the pose before it.
  std::size_t segment = 0;
  /// Distance along the path [m].
  double along_m = 0.0;
  /// Pose of the robot in collision.
  PlanarPose pose;
  /// Centre of the blocking cell under the footprint, map frame [m].
  Eigen::Vector2d cell_centre_map = Eigen::Vector2d::Zero();
  BlockReason reason = BlockReason::none;
};

struct PathCheck {
  TraversabilityStatus status = TraversabilityStatus::ok;
  std::string reason;
  /// Whether the whole path is free of conflicts.
  bool is_free = false;
  std::optional<PathConflict> conflict;
  /// Smallest `TraversabilityCell::clearance_m` under the footprint, up to the conflict [m]: 0 at a
  /// conflict with a lethal cell, at most `clearance_limit_m`.
  double clearance_m = 0.0;
  /// Length of the path, or up to the conflict [m].
  double checked_m = 0.0;
  /// Part of `checked_m` that lies on inferred ground [m].
  double inferred_m = 0.0;
  std::uint64_t map_version = 0;
};

/// Largest number of poses of one check.
inline constexpr std::size_t max_path_poses = 100'000;

/// Checks the robot's oriented footprint along the poses, interpolated linearly, in steps in which
/// no part of it moves more than half a cell. A path may be a single pose. An empty path and poses
/// that are not finite are invalid requests, paths that would take too long are too large.
/// Inscribed cells are no conflict: the footprint itself is tested.
[[nodiscard]] PathCheck check_path(const TraversabilityView& view,
                                   std::span<const PlanarPose> path_map);

/// As check_path, for paths of any length that no client sent: those of the planner.
[[nodiscard]] PathCheck check_long_path(const TraversabilityView& view,
                                        std::span<const PlanarPose> path_map);

/// A path to check, with or without headings.
struct PathQuery {
  /// Name of the robot profile, for a server that keeps several.
  std::string profile;
  /// Map frame [m].
  std::vector<Eigen::Vector2d> positions_map;
  /// One for each position, interpolated linearly. Or none: the robot drives straight from position
  /// to position and turns on the spot.
  std::vector<double> headings_rad;
};

/// Checks the path for the view's profile, whichever `query` names. A conflict's `segment` is an
/// index of `positions_map`. At most `max_path_poses` positions; without headings half as many, and
/// at least two.
[[nodiscard]] PathCheck check_path(const TraversabilityView& view, const PathQuery& query);

/// Boxes that hold what is within `reach_m` of the path, a polyline through the positions that are
/// finite (map frame [m]); never empty. They are small where the path is not too long to be
/// checked, since one box round a long path that bends holds far more of the map than the path
/// meets.
[[nodiscard]] std::vector<Eigen::AlignedBox2d> boxes_along(
    std::span<const Eigen::Vector2d> positions_map, double reach_m);

}  // namespace stillmap
