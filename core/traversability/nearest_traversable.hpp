#pragma once

#include <string>

#include "core/traversability/path_check.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap {

struct NearestTraversable {
  TraversabilityStatus status = TraversabilityStatus::ok;
  std::string reason;
  /// Centre of the nearest free cell, map frame [m].
  Eigen::Vector2d position_map = Eigen::Vector2d::Zero();
  /// Of the ground there [m].
  double height_m = 0.0;
  /// From the place asked for [m].
  double distance_m = 0.0;
  TraversabilityCell cell;
  std::uint64_t map_version = 0;
};

/// The free cell nearest to a place, at most `max_distance_m` away. Free cells keep the inscribed
/// radius from everything lethal: with some heading, the robot can stand there. Inferred ground
/// counts, unknown ground does not.
[[nodiscard]] NearestTraversable nearest_traversable(const TraversabilityView& view,
                                                     const Eigen::Vector2d& position_map,
                                                     double max_distance_m = 100.0);

}  // namespace stillmap
