#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "core/inertial/inertial_motion.hpp"
#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/prepare.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/lidar/trajectory.hpp"
#include "core/odometry/feature_map.hpp"
#include "core/odometry/odometry_config.hpp"
#include "core/odometry/odometry_state.hpp"
#include "core/odometry/prior_map.hpp"
#include "core/odometry/sweep_motion.hpp"

namespace stillmap {

/// Lidar odometry of the paper, II-C: features, correspondences in the local map, weighted
/// Gauss-Newton; and the local map that it registers against.
class Odometry {
 public:
  /// Throws std::invalid_argument with `config.faults()`.
  Odometry(const OdometryConfig& config, const SensorModel& sensor);
  ~Odometry();
  Odometry(Odometry&&) noexcept;
  Odometry& operator=(Odometry&&) noexcept;

  /// Motion that the next scan is expected to bring: the last one again (constant velocity), scaled
  /// to the time that passed.
  [[nodiscard]] Eigen::Isometry3d predict(
      std::int64_t stamp_ns, const std::optional<InertialMotion>& inertial = std::nullopt) const;

  /// Motion of the lidar during `period_s` at the last velocity, for motion compensation.
  [[nodiscard]] Eigen::Isometry3d motion_during(double period_s) const;

  /// Motion within the next sweep: its rotation by the IMU where there is one, all else by the last
  /// velocity.
  [[nodiscard]] SweepMotion sweep_motion(
      const SweepTimes& sweep, const std::optional<InertialMotion>& inertial = std::nullopt) const;

  /// Whether features are those of rings: register_scan() then needs `scan.ring`.
  [[nodiscard]] bool uses_rings() const;

  struct Step {
    OdometryResult result;
    /// Motion of every point of the scan (II-C.2).
    std::vector<Motion> motion;
    /// Pose of the lidar in the middle of the sweep.
    Eigen::Isometry3d T_map_lidar_middle = Eigen::Isometry3d::Identity();
  };

  /// Registers a prepared scan, splits its points by motion, and adds it to the local map.
  /// `scan.ring` must be known where uses_rings(). The points come moved to the middle of the sweep
  /// by sweep_motion(), with their times; they leave as if measured at the stamp, where the
  /// result's pose is, by the motion that was found, and without times.
  [[nodiscard]] Step register_scan(Scan& scan, const SweepTimes& sweep, const PointLabels& labels,
                                   const std::optional<Eigen::Isometry3d>& T_map_lidar_prior,
                                   const std::optional<InertialMotion>& inertial = std::nullopt);

  /// Adds points of a map made earlier (map frame) to the local map. Before the first scan: that
  /// scan is then relocalized in them, round its prior (see relocalize).
  void add_prior_map(std::span<const LabelledPoint> points_map);
  /// The same with a map that was made ready elsewhere, at once, where nothing was added since this
  /// one began.
  void begin_in(PriorMap prior);

  /// The next scans are of another lidar at the same place on the robot, or of the same one by
  /// another description: local map, velocity and health go on.
  void use_sensor(const SensorModel& sensor);

  /// The clock of the stamps was set: what was stamped before has a stamp so much later by it.
  void set_clock(std::int64_t shift_ns);

  /// Forgets poses and local map.
  void reset();

  /// The same for another map, but the lidar goes on as it moved: its velocity stays for a first
  /// scan that follows at once. That one is looked for up to `reach_m` from its prior, where that
  /// is given, instead of OdometryConfig::first_reach_m.
  void begin_map(const std::optional<double>& reach_m = std::nullopt);
  /// Before the first scan of a map: the lidar moved from one of these poses, of two scans at their
  /// stamps, to the other, and goes on as it did. A velocity that is known stays. Nothing is taken
  /// from what no lidar does, or from poses that are too long apart to tell a velocity.
  void go_on_from(const StampedPose& before_last, const StampedPose& last);
  /// Where the first scan of a map comes, in the middle of a sweep that is so long after its stamp:
  /// forgets a velocity of too long ago, or of another clock.
  void expect_first_scan(std::int64_t stamp_ns, std::int64_t after_stamp_ns = 0);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stillmap
