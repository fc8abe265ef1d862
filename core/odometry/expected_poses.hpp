#pragma once

#include <Eigen/Geometry>
#include <vector>

#include "core/odometry/pose_search.hpp"

namespace stillmap {

/// Where the lidar may be after the prediction has failed: there, where it was last, or straight on
/// from it. Only the first where motion has led too far from the last pose for it to be back.
[[nodiscard]] std::vector<Eigen::Isometry3d> starts_without_prediction(
    const RegisteredScan& last, const PosePrediction& prediction);

/// The nearest pose to this one that motion before a gap leads to: the prediction, the last pose,
/// or straight on from it. Only the first where motion has led on since the last pose.
[[nodiscard]] Eigen::Isometry3d nearest_expected(const Eigen::Isometry3d& T_map_lidar,
                                                 const RegisteredScan& last,
                                                 const PosePrediction& prediction);

/// Whether a pose belongs to the same drive as the one that was expected (see nearest_expected):
/// across a gap the lidar may have braked, sped up or turned; once lost it may be anywhere, unless
/// traffic hid what it knew for a moment.
[[nodiscard]] bool is_followed(const Eigen::Isometry3d& T_map_lidar,
                               const Eigen::Isometry3d& T_map_lidar_expected,
                               const PosePrediction& prediction);

}  // namespace stillmap
