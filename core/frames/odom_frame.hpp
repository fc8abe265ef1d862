#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>

#include "core/odometry/odometry_state.hpp"

namespace stillmap {

/// A pose in REP 105's chain: T_map_base = T_map_odom * T_odom_base.
struct OdomPose {
  Eigen::Isometry3d T_map_odom = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_odom_base = Eigen::Isometry3d::Identity();
  /// Velocity of base along its own axes: translation [m/s], rotation [rad/s].
  Eigen::Matrix<double, 6, 1> velocity = Eigen::Matrix<double, 6, 1>::Zero();
};

/// Splits poses in the map into a part that is continuous, and a correction. `odom` begins where
/// `map` does. Motion that two scans in a row confirm moves base in odom; where the map's pose
/// jumps (another map, found again after `lost`, a pose that no robot can have reached), base goes
/// on in odom as it is expected to, and T_map_odom takes the rest.
class OdomFrame {
 public:
  /// The next scan's pose. `motion_prior` is the motion of base since the last one by another
  /// odometry, for scans whose own is not known.
  OdomPose update(std::int64_t stamp_ns, const Eigen::Isometry3d& T_map_base, OdometryHealth health,
                  const std::optional<Eigen::Isometry3d>& motion_prior = std::nullopt);

  /// The map was corrected; poses in odom stay as they are.
  void correct_map(const Eigen::Isometry3d& T_new_old) { T_map_base_ = T_new_old * T_map_base_; }

  /// Poses are from now on in another map.
  void begin_map() { is_connected_ = false; }

 private:
  /// The motion that is expected where none is known.
  [[nodiscard]] Eigen::Isometry3d extrapolate(double interval_s);
  [[nodiscard]] bool is_believed(const Eigen::Isometry3d& motion, double interval_s);
  /// Not where another odometry jumps.
  [[nodiscard]] bool is_prior_believed(const Eigen::Isometry3d& motion_prior, double interval_s);

  std::optional<std::int64_t> last_stamp_ns_;
  Eigen::Isometry3d T_map_base_ = Eigen::Isometry3d::Identity();
  Eigen::Isometry3d T_odom_base_ = Eigen::Isometry3d::Identity();
  /// Of the last motion that was believed, a twist each second; nothing once it has gone on for
  /// too long.
  std::optional<Eigen::Matrix<double, 6, 1>> velocity_;
  /// Since that motion [s].
  double extrapolated_s_ = 0.0;
  /// The last pose is in the same map and was not lost.
  bool is_connected_ = false;
  /// Of a motion that was not believed, a scan ago.
  std::optional<Eigen::Matrix<double, 6, 1>> doubtful_velocity_;
  /// The same of the prior.
  std::optional<Eigen::Matrix<double, 6, 1>> doubtful_prior_;
};

}  // namespace stillmap
