#pragma once

#include <span>

#include "core/odometry/registration.hpp"

namespace stillmap {

/// Adds points of a prior map (map frame): poles, trunks and traffic signs to the edges, all others
/// to the planes. Movable objects are left out.
void insert_prior_map(std::span<const LabelledPoint> points_map, LocalMap& map);

/// The pose of a scan in a prior map: near `T_map_lidar_guess`, or, where the scan does not fit
/// there, up to `reach_m` from it along x and y at any heading (see correlative_search). `map`
/// holds the same points as `prior_map`, for the fine registration. The guess with health `lost`
/// where it fits nowhere: less than 60 % of what stands up in the scan lies on the map then.
[[nodiscard]] OdometryResult relocalize(const FeatureSets& features,
                                        std::span<const LabelledPoint> prior_map,
                                        const LocalMap& map,
                                        const Eigen::Isometry3d& T_map_lidar_guess,
                                        const OdometryConfig& config, double reach_m = 24.0);

}  // namespace stillmap
