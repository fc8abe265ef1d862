#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// The first place where a robot cannot follow a path.
struct PathConflict {
  /// The way goes from pose `segment` to the next one.
  std::size_t segment = 0;
  /// Way along the path up to there [m].
  double along_m = 0.0;
  /// Where the robot would stand.
  PlanarPose pose;
  /// Centre of the cell that its footprint must not touch, map frame [m].
  Eigen::Vector2d cell_centre_map = Eigen::Vector2d::Zero();
  BlockReason reason = BlockReason::none;
};

struct PathCheck {
  TraversabilityStatus status = TraversabilityStatus::ok;
  std::string reason;
  /// The whole path can be followed.
  bool is_free = false;
  std::optional<PathConflict> conflict;
  /// Smallest distance from a cell under the footprint to one that is lethal in itself [m], up to
  /// the conflict: 0 at a conflict with such a cell; never above `clearance_limit_m`.
  double clearance_m = 0.0;
  /// Length of the path, or up to the conflict [m].
  double checked_m = 0.0;
  /// Part of `checked_m` that lies on inferred ground [m].
  double inferred_m = 0.0;
  std::uint64_t map_version = 0;
};

/// What is checked at once at most: poses, and cells under the footprint summed over all steps.
/// For a car, the latter is some 20 km.
inline constexpr std::size_t max_path_poses = 100'000;
inline constexpr double max_path_cells = 5e7;

/// Moves the robot's oriented footprint along the poses, straight from one to the next and turning
/// evenly, in steps in which no part of it moves more than half a cell. One pose is a path too.
/// An empty path and poses that are not finite are invalid requests. Cells within the safety margin
/// (inflation) do not stop it: the footprint itself decides.
[[nodiscard]] PathCheck check_path(const TraversabilityView& view,
                                   std::span<const PlanarPose> path_map);

/// Can this robot follow this path?
struct PathQuery {
  /// Name of the robot profile, for a server that keeps several.
  std::string profile;
  /// Map frame [m].
  std::vector<Eigen::Vector2d> positions_map;
  /// One a position: the robot turns evenly from one to the next. Or none: it drives straight ahead
  /// from position to position and turns on the spot.
  std::vector<double> headings_rad;
};

/// Checks the path, whatever profile it names; a conflict's `segment` counts the positions. At most
/// `max_path_poses` positions, half as many without headings; without, there must be two.
[[nodiscard]] PathCheck check_path(const TraversabilityView& view, const PathQuery& query);

}  // namespace stillmap
