#pragma once

#include <Eigen/Geometry>
#include <optional>

#include "core/lidar/sensor_model.hpp"

namespace stillmap {

/// Decides whether the motion of the lidar that another odometry (wheels) foretells is believed: as
/// long as it foretells what is then registered at least about as well as the last motion,
/// repeated, does; and again where nothing was registered for some time that could tell. A single
/// motion that no robot can make is none, as that of an odometry that sets itself elsewhere. NOT
/// thread safe.
class MotionTrust {
 public:
  explicit MotionTrust(const MotionLimits& limits) : limits_(limits) {}

  /// Whether a robot can go on so after the last motion that was registered, or foretold: what goes
  /// on twice is no jump. `interval_s` > 0: the motion takes so long.
  [[nodiscard]] bool is_possible(const Eigen::Isometry3d& foretold, double interval_s);
  /// What was registered where the last one that was possible was foretold, or nothing was.
  void learn(const Eigen::Isometry3d& registered, double interval_s);
  /// Nobody knows how the lidar moved.
  void forget_motion();

  [[nodiscard]] bool is_believed() const { return is_believed_; }

 private:
  struct Motion {
    Eigen::Isometry3d T_before_after = Eigen::Isometry3d::Identity();
    double interval_s = 0.0;
  };
  [[nodiscard]] bool is_reachable(const Motion& last, const Eigen::Isometry3d& motion,
                                  double interval_s) const;

  MotionLimits limits_;
  std::optional<Motion> registered_;
  /// The last one of all, and that of the scan in work.
  std::optional<Motion> last_foretold_;
  std::optional<Eigen::Isometry3d> foretold_;
  bool is_believed_ = true;
  /// Motions in a row that were foretold and nobody learned of.
  int untold_ = 0;
  /// Means of squares over the last scans, in what is borne.
  double missed_ = 0.0;
  double missed_by_repetition_ = 0.0;
};

}  // namespace stillmap
