#pragma once

#include <Eigen/Core>
#include <span>
#include <string>

#include "core/lidar/labelled_scan.hpp"

namespace stillmap {

/// Cars and larger vehicles stand apart on the ground. What a network takes for one
/// in the middle of something else mostly is a part of that: a piece of a hedge, of a wall, of a
/// crash barrier. Bicycles and motorcycles lean on walls: they are left alone.
struct IslandVoteConfig {
  /// Edge of the cubes in which points touch [m].
  double edge_m = 0.3;
  /// An island goes to what surrounds it where the votes there are this share of its own or more.
  double share = 0.7;

  /// Every fault in words, one a line; empty when the configuration can be used.
  [[nodiscard]] std::string faults() const;
};

/// Points of cars, trucks and other vehicles that are connected, cube by cube with all 26 around,
/// are an island. Around it vote the points of classes that are neither vehicle nor ground, in its
/// cubes and those beside their six sides, with their confidences, as the island's own points do.
/// Where the former have `share` of the votes of the latter, the whole island takes the class with
/// most votes around it, with these divided by the number of all that voted as confidence. It does
/// not where three quarters of the votes around are from points nearer to the lidar than the
/// vehicle's beside them, which is a car behind a mesh or a low hedge. Points farther than a
/// million edges from the lidar, and those without a class, neither vote nor change. `labels` is as
/// long as `points_lidar`.
void vote_on_islands(std::span<const Eigen::Vector3f> points_lidar, const IslandVoteConfig& config,
                     PointLabels& labels);

}  // namespace stillmap
