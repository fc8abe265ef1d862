#pragma once

#include "core/odometry/fit_statistics.hpp"
#include "core/odometry/registration.hpp"
#include "core/odometry/se3.hpp"
#include "core/odometry/sweep_motion.hpp"

namespace stillmap {

/// Time beyond which the last velocity is not extrapolated [s].
constexpr double max_prediction_s = 1.0;

/// The last scan that was registered.
struct RegisteredScan {
  FeatureSets features;
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
  /// Motion from the scan before it, and the time between them [s]; 0: there was none.
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  double interval_s = 0.0;
  /// 0 while it is not known.
  [[nodiscard]] double speed_m_s() const {
    return interval_s > 0.0 ? motion.translation().norm() / interval_s : 0.0;
  }
  /// What the velocity says of a time to come; no motion where it does not say.
  [[nodiscard]] Eigen::Isometry3d motion_during(double period_s) const;
  /// What it tells of a sweep so long after it, whose points were compensated for a motion.
  [[nodiscard]] SweepPrior sweep_prior(double interval_to_next_s, const SweepTimes& sweep,
                                       const SweepMotion& compensated) const;
};

/// Where the next scan is expected.
struct PosePrediction {
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
  /// Time since the last registered scan [s].
  double interval_s = 0.0;
  /// What may have been driven since the lidar was last followed, at its speed of then [m].
  double driven_m = 0.0;
  /// A velocity or a prior tells it.
  bool is_known = false;
  /// A prior tells it, of what the scan itself does not show, too.
  bool is_prior = false;
  /// The motion along a stretch that was forgotten leads there: not the last registered scan's.
  bool is_led = false;
  /// Scans in a row before this one that could not be registered.
  int lost_scans = 0;
  /// Starts farther off are tried, too: not for every one of many lost scans.
  bool is_searched_widely = true;
};

/// A second opinion: `found`, where the alignment of points (of any kind and class) stays there;
/// the pose that registration finds from where they align, where both agree on that one and the
/// points fit better; else `found`, degenerate.
[[nodiscard]] OdometryResult confirmed_by_points(const OdometryResult& found,
                                                 const FeatureSets& features, const LocalMap& map,
                                                 const OdometryConfig& config);

/// The same of one of the first scans, which little is known to judge by. What of a sparse lidar's
/// rings lies on the road goes along with it, and pulls two sparse scans together by up to a metre:
/// where the points align clearly better some way off, the pose there, degenerate, with its tilt
/// and height as the features have them. Where the start is known (in a map made earlier, or of a
/// lidar that goes on as it moved) only where the points do not stay.
[[nodiscard]] OdometryResult confirmed_at_start(const OdometryResult& found,
                                                const FeatureSets& features, const LocalMap& map,
                                                bool is_start_known, const OdometryConfig& config);

/// Where a scan lies to the last one, which alone is in the map, where features are too few within
/// the reach of registration: rings on walls 40 m off are farther apart. By features over the reach
/// of a coarse map, where what stands up fits, else where the points align; nothing where most of
/// them do not. The last scan's where that is no farther than either errs by.
[[nodiscard]] std::optional<Eigen::Isometry3d> pose_to_last_scan(const FeatureSets& features,
                                                                 const LocalMap& map,
                                                                 const RegisteredScan& last,
                                                                 const OdometryConfig& config);

/// `found`, or, of a scan of which labels leave less than half, where the points align, degenerate,
/// if those of any class and those of classes that cannot move want to go the same way: then it is
/// not traffic that pulls them, but the few features left that slide, such as by wrong labels.
[[nodiscard]] OdometryResult moved_where_points_agree(const OdometryResult& found,
                                                      const FeatureSets& features,
                                                      const LocalMap& map,
                                                      const OdometryConfig& config);

/// `found`, but no pose that was found without a robust kernel is good unless it stays where it is
/// with one: traffic pulls the one along, and not the other.
[[nodiscard]] OdometryResult doubted_where_pulled(OdometryResult found, const FeatureSets& features,
                                                  const LocalMap& map,
                                                  const OdometryConfig& config);

/// Whether a pose fits so much worse than poses have lately that motion alone could vouch for it,
/// and motion led elsewhere: for the length of a scan, streets of two cities may look alike.
[[nodiscard]] bool is_unvouched(const OdometryResult& found, const PosePrediction& prediction,
                                const FitStatistics& fits);

/// Whether registration came by itself to where motion led, and the points agree: then the lidar is
/// there, however little dense traffic leaves of what the map knows. Never of a prior's pose, which
/// is no witness of its own, and not in the paper.
[[nodiscard]] bool is_foretold(const OdometryResult& found, const FeatureSets& features,
                               const LocalMap& map, const PosePrediction& prediction,
                               const FitStatistics& fits, const OdometryConfig& config);

/// How much speaks for the pose of a map's second scan, by two witnesses. The features of two scans
/// alone may agree on a wrong motion: rings on the road fit at any speed, and so do posts and rails
/// of which other beams hit other ones. The points then lie much worse on each other. Of a later
/// scan it tells which of two registrations is right.
[[nodiscard]] double score_of_first_motion(const OdometryResult& second,
                                           const FeatureSets& features, const LocalMap& map,
                                           const OdometryConfig& config);

/// From the prediction alone, in two stages where that does not fit: before other starts are tried.
/// The better of both, found by few features and refined by all. A robust kernel
/// takes many small steps to a pose that the prediction misses.
[[nodiscard]] OdometryResult search_near_prediction(const FeatureSets& features,
                                                    const LocalMap& map,
                                                    const PosePrediction& prediction,
                                                    const FitStatistics& fits,
                                                    const OdometryConfig& config);

/// A pose that few features found, by all of them.
[[nodiscard]] OdometryResult refined(const OdometryResult& found, const FeatureSets& features,
                                     const LocalMap& map, const OdometryConfig& config);

/// All starts that may lead to the pose, the cheapest first, until one fits.
[[nodiscard]] OdometryResult search_pose(const FeatureSets& features, const LocalMap& map,
                                         const RegisteredScan& last,
                                         const PosePrediction& prediction,
                                         const FitStatistics& fits, const OdometryConfig& config);

}  // namespace stillmap
