#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>

#include "core/frames/odom_frame.hpp"
#include "core/odometry/motion_trust.hpp"
#include "server/mapping/odometry_prior.hpp"
#include "server/mapping/robot_frames.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"

namespace stillmap::server {

/// What the odometry prior, whose poses are those of some frame on the robot, says of the robot and
/// its lidar. What cannot be used is counted and logged, and is the status' reason where it lasts.
class RobotPrior {
 public:
  /// `prior` may be null: then it says nothing. All must outlive it.
  RobotPrior(const OdometryPrior* prior, const RobotFrames& frames, std::string odom_frame,
             const MotionLimits& limits, Statistics& statistics)
      : prior_(prior),
        trust_(limits),
        frames_(frames),
        odom_frame_(std::move(odom_frame)),
        statistics_(statistics) {}

  /// Motion of the lidar; nothing where the prior does not cover both times, jumps, moves a frame
  /// whose place on the robot is not known, or does not foretell what is registered.
  [[nodiscard]] std::optional<Eigen::Isometry3d> lidar_motion(std::int64_t from_ns,
                                                              std::int64_t to_ns);
  /// Where the scan was registered that it was asked for last, after these poses.
  void learn(const Trajectory& before, std::int64_t stamp_ns, const OdometryResult& odometry);
  /// Base in the prior's odom, whose place in the map is that of the newest scan of the last
  /// seconds that the prior has a pose for: one that is late costs nothing. Without any, odom stays
  /// where it was in the map; nothing where that is not known yet.
  [[nodiscard]] std::optional<OdomPose> pose_in_odom(std::int64_t stamp_ns,
                                                     const Eigen::Isometry3d& T_map_base);
  /// The map's poses were moved by this.
  void correct_map(const Eigen::Isometry3d& T_corrected_map);
  /// Poses are from now on in another map, or elsewhere in it.
  void forget_poses() {
    poses_.clear();
    T_map_odom_.reset();
    trust_.forget_motion();
  }

 private:
  /// Whether it said something of this time.
  void report(bool has_said, std::int64_t stamp_ns);
  void refuse(const std::string& counter, const std::string& reason);
  /// Where trust was lost or regained.
  void tell_of_trust();

  const OdometryPrior* prior_;
  MotionTrust trust_;
  bool was_believed_ = true;
  const RobotFrames& frames_;
  std::string odom_frame_;
  Statistics& statistics_;
  ThrottledLog throttled_log_;
  std::optional<Eigen::Isometry3d> T_map_odom_;
  struct BasePose {
    std::int64_t stamp_ns = 0;
    Eigen::Isometry3d T_map_base = Eigen::Isometry3d::Identity();
  };
  /// Of the last seconds, the newest last.
  std::deque<BasePose> poses_;
  /// Scans in a row that it said nothing of.
  int silent_scans_ = 0;
  /// And those that nobody knows of where odom is.
  int unknown_scans_ = 0;
};

}  // namespace stillmap::server
