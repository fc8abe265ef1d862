#pragma once

#include <span>

#include "core/odometry/registration.hpp"

namespace stillmap {

/// A lost scan is looked for up to so far away, and farther by what was driven since [m].
constexpr double relocalization_reach_m = 24.0;

/// All points of the map.
[[nodiscard]] std::vector<LabelledPoint> points_of(const LocalMap& map);

/// Poses that the scan may have been taken from, the best first, up to `reach_m` from the guess
/// along x and y at any heading: those that put its landmarks on landmarks of the map (see
/// correlative_search). Landmarks are what is neither ground nor movable.
[[nodiscard]] std::vector<Eigen::Isometry3d> propose_poses(
    const FeatureSets& features, std::span<const LabelledPoint> points_map,
    const Eigen::Isometry3d& T_map_lidar_guess, double reach_m, std::size_t count);

/// The pose of a scan in a prior map: near `T_map_lidar_guess`, or, where the scan does not fit
/// there, up to `reach_m` from it along x and y at any heading (see correlative_search). `map`
/// holds the same points as `prior_map`, for the fine registration. The guess with health `lost`
/// where it fits nowhere: less than 60 % of what stands up in the scan lies on the map then. With a
/// reach of 0 it is looked for within some metres of the guess alone, and must fit well.
[[nodiscard]] OdometryResult relocalize(const FeatureSets& features,
                                        std::span<const LabelledPoint> prior_map,
                                        const LocalMap& map,
                                        const Eigen::Isometry3d& T_map_lidar_guess,
                                        const OdometryConfig& config, double reach_m);

}  // namespace stillmap
