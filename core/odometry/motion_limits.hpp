#pragma once

#include <Eigen/Geometry>

#include "core/lidar/sensor_model.hpp"
#include "core/odometry/pose_search.hpp"

namespace stillmap {

/// Whether a robot within these limits can have come from the last scan's pose to this one in
/// `interval_s` > 0, by what a pose's own noise leaves to be seen. `has_velocity`: the last scan
/// tells it, and so how far the way bends or changes speed.
[[nodiscard]] bool is_reachable(const RegisteredScan& last, const Eigen::Isometry3d& T_map_lidar,
                                double interval_s, bool has_velocity, const MotionLimits& limits);

/// Makes a pose lost, and says why, that the robot cannot have reached from the last scan's. One
/// that a prior predicts may lie anywhere, as that of a source that corrects itself does.
/// `last_moved_within_limits`: the last motion may tell the velocity.
void keep_to_limits(const RegisteredScan& last, const PosePrediction& prediction,
                    bool last_moved_within_limits, const MotionLimits& limits,
                    OdometryResult& result);

}  // namespace stillmap
