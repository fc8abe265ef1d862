#pragma once

#include <optional>
#include <span>
#include <utility>

#include "core/odometry/pose_search.hpp"
#include "core/odometry/scan_intervals.hpp"

namespace stillmap {

/// What may have happened to a pose since the last one that was confirmed: covariance of
/// (translation [m], rotation [rad]) in the map frame. `is_followed`: it has only slid since.
[[nodiscard]] Eigen::Matrix<double, 6, 6> drift_covariance(const RegisteredScan& known,
                                                           double since_s, bool is_followed);

/// Of a pose of which nothing is known: deviations of 1 km, and of all directions alike.
[[nodiscard]] Eigen::Matrix<double, 6, 6> unknown_pose_covariance();

/// Scans whose place nothing older than they are has confirmed, since one of them did not show all
/// of its motion or was found where it was not expected. They extend the local map, so that the
/// motion among them is known, and so agree with one another wherever they are. What was known
/// before them is kept here: it alone can tell that they are where they seem to be.
class UnconfirmedStretch {
 public:
  /// What odometry knew before the stretch.
  struct Trusted {
    LocalMap map;
    RegisteredScan last;
    ScanIntervals intervals;
    FitStatistics fits;
  };
  enum class Decision {
    /// The scan lies on the trusted map.
    confirmed,
    /// The trusted map does not tell, or not yet.
    open,
    /// The trusted map knows this place, and the scan is not of it.
    contradicted,
    /// The trusted map is out of sight: what was driven since shows its motion all along, and the
    /// stretch can only be taken for what it says.
    settled,
  };

  explicit UnconfirmedStretch(Trusted trusted) : trusted_(std::move(trusted)) {}

  /// No motion has told where the next scan is: it was looked for, and found elsewhere than it may
  /// be expected. Places look alike.
  void jump(const Eigen::Isometry3d& T_map_lidar_expected,
            const Eigen::Isometry3d& T_map_lidar_found);

  /// Judges the stretch by a scan that was registered at `found`; one that is degenerate itself
  /// tells nothing. Where it is confirmed, `found` becomes the pose in the trusted map. Says what
  /// that is worth to a map: a stretch that was followed all along is a part of it once its end is.
  [[nodiscard]] Decision evaluate(const FeatureSets& features, const OdometryConfig& config,
                                  OdometryResult& found);

  /// Points that were stored before the stretch, and are near only now.
  void add_prior_map(std::span<const LabelledPoint> points_map);
  /// See ScanIntervals::set_clock().
  void set_clock(std::int64_t shift_ns) { trusted_.intervals.set_clock(shift_ns); }
  [[nodiscard]] const Trusted& trusted() const { return trusted_; }
  [[nodiscard]] bool has_jumped() const { return has_jumped_; }
  /// A pose of the stretch as it would be had it not jumped: where motion alone led to.
  [[nodiscard]] Eigen::Isometry3d where_motion_led(const Eigen::Isometry3d& T_map_lidar) const {
    return T_led_found_ * T_map_lidar;
  }
  /// Whether a search from where motion led to, up to there and then for so far on [m], may come to
  /// the last pose before the stretch.
  [[nodiscard]] bool is_in_reach(const Eigen::Isometry3d& T_map_lidar, double driven_m) const;
  /// Ends the stretch.
  [[nodiscard]] Trusted take_trusted() { return std::move(trusted_); }

 private:
  [[nodiscard]] bool stands_on_trusted_map(const OdometryResult& in_trusted_map) const;
  [[nodiscard]] Decision decide(const OdometryResult& in_trusted_map, const OdometryResult& found);
  [[nodiscard]] double distance_from_trusted_m(const Eigen::Isometry3d& T_map_lidar) const;
  /// Whether a stretch that has jumped is to be given up at this pose, since nothing agrees.
  [[nodiscard]] bool is_overdue(const Eigen::Isometry3d& T_map_lidar) const;
  [[nodiscard]] MapEntry entry_of_open() const;

  /// Counts the way on which scans showed all of their motion.
  void count_good(const OdometryResult& found);
  void count_agreeing(bool agrees, const Eigen::Vector3d& position_map);
  void count_contradicting(bool contradicts) {
    contradicting_scans_ = contradicts ? contradicting_scans_ + 1 : 0;
  }

  Trusted trusted_;
  bool has_jumped_ = false;
  /// So far that a place that looks alike may have been taken for the right one.
  bool has_jumped_far_ = false;
  /// Takes poses of the stretch to where motion alone led.
  Eigen::Isometry3d T_led_found_ = Eigen::Isometry3d::Identity();
  /// Scans since the jump, and those in a row that come to the same place in the trusted map, or
  /// that it contradicts.
  int scans_since_jump_ = 0;
  int agreeing_scans_ = 0;
  bool has_agreed_ = false;
  /// What was driven while they agreed [m], and where they did last.
  double agreeing_path_m_ = 0.0;
  Eigen::Vector3d agreed_at_map_ = Eigen::Vector3d::Zero();
  int contradicting_scans_ = 0;
  /// Driven while scans showed all of their motion [m], and where one did last.
  double good_path_m_ = 0.0;
  std::optional<Eigen::Vector3d> good_at_map_;
};

}  // namespace stillmap
