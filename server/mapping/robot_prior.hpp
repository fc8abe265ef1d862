#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>

#include "core/frames/odom_frame.hpp"
#include "server/mapping/odometry_prior.hpp"
#include "server/mapping/robot_frames.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"

namespace stillmap::server {

/// What the odometry prior, whose poses are those of some frame on the robot, says of the robot and
/// its lidar. What cannot be used is counted and logged.
class RobotPrior {
 public:
  /// `prior` may be null: then it says nothing. All must outlive it.
  RobotPrior(const OdometryPrior* prior, const RobotFrames& frames, std::string odom_frame,
             Statistics& statistics)
      : prior_(prior),
        frames_(frames),
        odom_frame_(std::move(odom_frame)),
        statistics_(statistics) {}

  /// Motion of the lidar; nothing where the prior does not cover both times, jumps, or moves a
  /// frame whose place on the robot is not known.
  [[nodiscard]] std::optional<Eigen::Isometry3d> lidar_motion(std::int64_t from_ns,
                                                              std::int64_t to_ns);
  /// Base in the prior's odom. Without a pose of this time, odom stays where it was in the map.
  [[nodiscard]] OdomPose pose_in_odom(std::int64_t stamp_ns, const Eigen::Isometry3d& T_map_base);
  /// The map's poses were moved by this.
  void correct_map(const Eigen::Isometry3d& T_corrected_map) {
    T_map_odom_ = T_corrected_map * T_map_odom_;
  }

 private:
  void refuse(const std::string& counter, const std::string& reason);

  const OdometryPrior* prior_;
  const RobotFrames& frames_;
  std::string odom_frame_;
  Statistics& statistics_;
  ThrottledLog throttled_log_;
  Eigen::Isometry3d T_map_odom_ = Eigen::Isometry3d::Identity();
};

}  // namespace stillmap::server
