#pragma once

#include <Eigen/Geometry>

#include "core/odometry/registration.hpp"

namespace stillmap {

/// How much better a scan's `points` lie on earlier ones at `T_map_lidar_other` than at
/// `T_map_lidar`, as a ratio, by what of them tells the two poses apart. Where on a smooth wall a
/// lidar's rings lie is chance: they go along with the lidar, as they do on level ground, and lie
/// best where it has not moved. So a point does not count along its ring's tangent, and the less
/// the more that runs along the way from one pose to the other. 1 where no tangents are known.
[[nodiscard]] double gain_of_telling_points(const FeatureSets& features,
                                            const FeatureMap& points_map,
                                            const Eigen::Isometry3d& T_map_lidar,
                                            const Eigen::Isometry3d& T_map_lidar_other,
                                            const SweepCorrection& sweep_correction);

}  // namespace stillmap
