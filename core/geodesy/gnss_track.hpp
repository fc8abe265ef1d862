#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "core/geodesy/east_north_up.hpp"
#include "core/geodesy/gnss_delay.hpp"
#include "core/geodesy/gnss_fix.hpp"

namespace stillmap {

struct GnssConfig {
  /// `min_sigma_m` where nobody knows where on the robot the antenna is [m].
  static constexpr double size_of_robot_m = 1.0;

  /// Fixes that are said to be worse than this, east and north, are not used [m].
  double max_sigma_m = 20.0;
  /// None is believed to be better than this along any axis [m].
  double min_sigma_m = 0.02;
  /// Of where the antenna is, along x and y of the lidar; 0: it is where it is said to be [m].
  double antenna_sigma_m = 0.0;
  /// How late the stamps are [s]; nothing: that is to be found out.
  std::optional<double> delay_s;

  /// Of a receiver that is somewhere on the robot.
  void expect_antenna_anywhere() { min_sigma_m = antenna_sigma_m = size_of_robot_m; }
};

/// A fix, by the scan after it.
struct PositionAtScan {
  /// Number of the scan.
  std::size_t scan = 0;
  /// The antenna in the frame of that scan's lidar [m]: where it was a moment before.
  Eigen::Vector3d antenna_lidar = Eigen::Vector3d::Zero();
  /// About the track's origin [m].
  Eigen::Vector3d position_enu = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance_enu = Eigen::Matrix3d::Identity();
};

/// Puts the fixes of a receiver on the robot between the scans around them. Fixes and scans come in
/// their own order, each after the other or before it, by one clock. The first fix is the origin of
/// the positions, unless more than so many that follow it (and five at least) lie together more
/// than 50 km from it: the first of those is, then. Stamps that are late, or of GPS time, do not
/// fit the way by odometry, and how late they are is found out from that. NOT thread safe.
class GnssTrack {
 public:
  explicit GnssTrack(const GnssConfig& config)
      : config_(config), delay_{.delay_s = config.delay_s.value_or(0.0)} {}

  /// Returns why it is not used; empty where it is.
  [[nodiscard]] std::string add(const GnssFix& fix);
  /// Scans have rising numbers. `antenna_lidar`: where the antenna is on the lidar [m]. Where the
  /// scans' clock is set back, what waits is dropped.
  void add_scan(std::size_t scan, std::int64_t stamp_ns, const Eigen::Isometry3d& T_odom_lidar,
                const Eigen::Vector3d& antenna_lidar);
  /// Fixes that lie between two scans now; each once.
  [[nodiscard]] std::vector<PositionAtScan> take();
  /// Finds out how late the stamps are, now and then as the way grows; `is_end`: of all of it.
  /// Returns whether that is another delay, or another antenna, than until now: then the positions
  /// that were taken before mean nothing any more, and take() has all of them again. So it stays
  /// what it is once some of the way is no longer kept: of 50,000 scans and as many fixes.
  [[nodiscard]] bool judge_delay(bool is_end = false);
  /// Found out until now.
  [[nodiscard]] const GnssDelay& delay() const { return delay_; }

  /// The frame of the positions; nothing before the first fix.
  [[nodiscard]] const std::optional<EastNorthUp>& enu() const { return enu_; }
  /// How many origins there were: with another one the positions that were taken before mean
  /// nothing any more.
  [[nodiscard]] std::size_t origins() const { return origins_; }
  /// Fixes that were put between scans.
  [[nodiscard]] std::size_t placed() const { return placed_; }
  /// Those that no two scans lie around, or that waited when another origin was found.
  [[nodiscard]] std::size_t misplaced() const { return misplaced_; }

 private:
  struct ScanPose {
    std::size_t scan = 0;
    std::int64_t stamp_ns = 0;
    Eigen::Isometry3d T_odom_lidar = Eigen::Isometry3d::Identity();
    Eigen::Vector3d antenna_lidar = Eigen::Vector3d::Zero();
  };
  [[nodiscard]] Eigen::Vector3d antenna_odom(const ScanPose& scan) const;
  /// Finds another origin where fixes say that they are of another place.
  void judge_origin(const GnssFix& fix);
  /// Drops what waits of other places.
  void begin_at(const GnssFix& fix);
  /// Keeps it for another delay.
  void remember(const GnssFix& fix);
  /// What was there then is no longer kept. Of a robot that stood nothing is lost by that.
  void forget_way(std::int64_t stamp_ns);
  [[nodiscard]] std::optional<GnssDelay> estimated_delay() const;
  [[nodiscard]] std::optional<PositionAtScan> between_scans(const GnssFix& fix) const;
  /// When the robot was there.
  [[nodiscard]] std::int64_t time_of(const GnssFix& fix) const;

  GnssConfig config_;
  std::optional<EastNorthUp> enu_;
  std::size_t origins_ = 0;
  /// Those that follow from the origin without a jump, and the last of them.
  std::size_t believed_ = 0;
  GnssFix last_believed_;
  /// Those since then, of one other place.
  std::size_t strays_ = 0;
  GnssFix first_stray_;
  GnssFix last_stray_;
  std::deque<GnssFix> waiting_;
  /// The newest of all, those of a robot that stands one a second.
  std::deque<GnssFix> known_;
  /// The newest.
  std::deque<ScanPose> scans_;
  GnssDelay delay_;
  /// Of the first scan, and when the robot had left that place.
  std::optional<Eigen::Vector3d> begin_odom_;
  std::optional<std::int64_t> left_ns_;
  /// Whether positions that were taken could not be had again.
  bool has_forgotten_way_ = false;
  /// Way of the lidar, and where the delay is judged next [m].
  double way_m_ = 0.0;
  double next_judged_m_ = 100.0;
  std::size_t placed_ = 0;
  std::size_t misplaced_ = 0;
};

}  // namespace stillmap
