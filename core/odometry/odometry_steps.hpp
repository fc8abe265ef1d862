#pragma once

#include <algorithm>
#include <cstdint>
#include <optional>
#include <vector>

#include "core/odometry/features.hpp"
#include "core/odometry/first_scan.hpp"
#include "core/odometry/flat_fit.hpp"
#include "core/odometry/motion_classification.hpp"
#include "core/odometry/motion_limits.hpp"
#include "core/odometry/odometry.hpp"
#include "core/odometry/pose_search.hpp"
#include "core/odometry/registration.hpp"
#include "core/odometry/ring_start.hpp"
#include "core/odometry/scan_features.hpp"
#include "core/odometry/scan_intervals.hpp"
#include "core/odometry/se3.hpp"
#include "core/odometry/unconfirmed_stretch.hpp"

namespace stillmap {

/// Where motion led along a stretch that was forgotten, until a scan is found again: the robot has
/// moved since its place was known for sure.
struct LedSince {
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
  /// The last motion along the stretch, the time it took [s], and the times of its scans.
  Eigen::Isometry3d motion = Eigen::Isometry3d::Identity();
  double interval_s = 0.0;
  ScanIntervals intervals;

  /// By the last motion, for as long as that tells anything.
  [[nodiscard]] Eigen::Isometry3d T_map_lidar_at(std::int64_t time_ns) const {
    if (interval_s <= 0.0) return T_map_lidar;
    const double since_s = std::min(intervals.since_last_s(time_ns), max_prediction_s);
    return T_map_lidar * scaled_motion(motion, since_s / interval_s);
  }
  /// What may have been driven since, at the speed of then [m].
  [[nodiscard]] double driven_m(std::int64_t time_ns) const {
    if (interval_s <= 0.0) return 0.0;
    return motion.translation().norm() / interval_s * intervals.since_last_s(time_ns);
  }
};

/// What Odometry keeps from scan to scan, and the steps of registering one.
struct Odometry::State {
  State(const OdometryConfig& odometry_config, const SensorModel& sensor_model)
      : config(odometry_config.with_method()),
        first_config(odometry_config.at_start()),
        sensor(sensor_model),
        first_reach_m(odometry_config.first_reach_m),
        map(odometry_config.local_map),
        history(odometry_config.motion),
        intervals(sensor_model.period_s),
        is_by_surfaces(is_registered_by_surfaces(sensor, config)) {}

  /// The range image of the scan for the history; nothing where none is kept.
  [[nodiscard]] std::optional<RangeImageView> view_of(const Scan& scan, const PointLabels& labels,
                                                      const Eigen::Isometry3d& T_map_lidar) const {
    if (labels.empty() || !config.motion.use_range_image_history) return std::nullopt;
    return RangeImageView(scan, labels.classes, sensor, T_map_lidar);
  }
  [[nodiscard]] std::vector<MotionClass> classify(const ScanInParts& parts,
                                                  const Eigen::Isometry3d& T_map_lidar) const {
    if (!parts.view) return std::vector<MotionClass>(parts.objects.count, MotionClass::undecided);
    return classify_motion(parts.scan, parts.objects, T_map_lidar, history, *parts.view,
                           config.motion);
  }
  /// Whether the last velocity predicts the pose of a scan of this time.
  [[nodiscard]] bool has_velocity(std::int64_t stamp_ns) const;
  /// Whether the local map is that of some first scans: whatever the lidar, the nearest points of
  /// most of theirs lie along one sweep of a beam. Not while a first scan that rolled is bent: wide
  /// planes of it lead the second one astray.
  [[nodiscard]] bool is_map_young() const {
    return !fits.are_known() && !first_scan && !has_prior_map && !config.paper_exact;
  }
  /// What scans are registered by now.
  [[nodiscard]] const OdometryConfig& method() const {
    return fits.are_known() ? config : first_config;
  }
  [[nodiscard]] bool is_searched_widely() const {
    return lost_scans == 0 || lost_scans % config.relocalization_interval == 1;
  }
  /// The IMU's rotation once the first scans have told the velocity; before that the first scan is
  /// straightened without it. The paper has none.
  [[nodiscard]] bool follows(const std::optional<InertialMotion>& inertial) const {
    return inertial && started && !first_scan && !config.paper_exact;
  }
  /// By the last motion since that pose, turned as the IMU says.
  [[nodiscard]] Eigen::Isometry3d motion_to_middle(
      double interval_s, const std::optional<InertialMotion>& inertial) const;
  /// From the middle of a sweep to its stamp: within the sweep by its own motion, before and after
  /// it by the last motion, since what a short sweep tells of its own does not reach far.
  [[nodiscard]] Eigen::Isometry3d motion_to_stamp(const SweepTimes& sweep,
                                                  const SweepMotion& compensated,
                                                  const SweepCorrection& correction) const;
  /// Where a scan is, by a prior or the map's origin, else by the last motion.
  [[nodiscard]] PosePrediction predict(std::int64_t time_ns,
                                       const std::optional<Eigen::Isometry3d>& T_map_lidar_known,
                                       bool is_prior,
                                       const std::optional<InertialMotion>& inertial) const;
  /// Finds features, objects and the range image of a scan, and what its objects do, seen from the
  /// predicted pose.
  void take_apart(ScanInParts& parts, const PosePrediction& prediction) const;
  /// Where a map begins: takes a scan apart again, into surfaces, if the rings are not far apart
  /// and there are no labels, or little stands up, or if they are far apart, little stands up and
  /// the ground is smooth. In the open single rings hold little but the ground, on which they lie
  /// wherever the lidar has gone. (Where much stands up, and a whole class of labels may be wrong,
  /// edges are the surer ones.)
  void choose_beginning(ScanInParts& parts, const PosePrediction& prediction);
  /// The pose, and the features that it was found by: few of them where these fit.
  [[nodiscard]] OdometryResult find_pose(ScanInParts& parts, const PosePrediction& prediction,
                                         FeatureSets& features) const;
  /// Classifies what moves at the registered pose where the predicted one was far from it, and
  /// registers again without that.
  void reclassify_motion(ScanInParts& parts, const Eigen::Isometry3d& T_map_lidar_predicted,
                         FeatureSets& features, OdometryResult& result) const;
  [[nodiscard]] OdometryResult estimate_pose(const FeatureSets& features,
                                             const PosePrediction& prediction) const;
  /// Asks the points for a second opinion, and the limits; the paper has neither.
  void confirm(const FeatureSets& features, const PosePrediction& prediction,
               OdometryResult& result) const;
  /// Calls a pose good only where the map says so that is older than any doubt of the place.
  void confirm_place(const FeatureSets& features, const PosePrediction& prediction,
                     OdometryResult& result);
  /// A pose that rests on what could move is denied unless that has proved to stand, or the rest
  /// agrees: what stands beside the lidar may set off, with it or without. Where the rest was not
  /// seen where that pose would have it, another one is found without.
  void judge_what_could_move(ScanInParts& parts, const PosePrediction& prediction,
                             FeatureSets& features, OdometryResult& result);
  /// Takes this scan for the first one where no other could be registered to that.
  void begin_anew(const FeatureSets& features, OdometryResult& result);
  /// Local map and velocity as they were before the stretch; where its motion led stays known.
  void forget_stretch();
  /// Range images, and what they told of objects that could move.
  void forget_objects() {
    history = RangeImageHistory(config.motion);
    movable = MovableUse::none;
    is_movable_denied = false;
  }
  /// To the covariance of a pose that is not confirmed.
  void add_drift(std::int64_t time_ns, const PosePrediction& prediction, OdometryResult& result);
  [[nodiscard]] SweepPrior sweep_prior(std::int64_t time_ns, const SweepTimes& sweep,
                                       const SweepMotion& motion) const {
    if (!started) return {};
    return last.sweep_prior(intervals.since_last_s(time_ns), sweep, motion);
  }
  /// What a registered scan leaves to the next one: map, fit, motion and features.
  void take(ScanInParts& parts, const Step& step, std::int64_t time_ns, FeatureSets features);
  void extend_map(const ScanInParts& parts, const Step& step,
                  const Eigen::Isometry3d& T_map_middle);
  /// Keeps a scan of a lidar of few rings, and goes on by surfaces once the first ones are known.
  void go_on_by_surfaces(const ScanInParts& parts, const Step& step);
  /// The first scan by the motion to the second, where that one rolled.
  void straighten(const FeatureSets& features, std::int64_t time_ns, const SweepTimes& sweep,
                  OdometryResult& second);
  void update_state(std::int64_t stamp_ns, std::optional<RangeImageView> view,
                    const Eigen::Isometry3d& T_map_lidar);

  OdometryConfig config;
  /// Until enough scans are known to judge one by.
  OdometryConfig first_config;
  SensorModel sensor;
  double first_reach_m;
  LocalMap map;
  std::optional<FirstScan> first_scan;
  /// Points of a prior map, until the first scan is registered against it.
  std::vector<LabelledPoint> prior_map;
  RangeImageHistory history;
  /// Since the place is in doubt.
  std::optional<UnconfirmedStretch> stretch;
  /// While lost after one.
  std::optional<LedSince> led;
  bool started = false;
  bool has_prior_map = false;
  /// The lidar moves as it did in the map before this one.
  bool goes_on = false;
  /// Times of the scans before it are those of their stamps, not yet of the middles of sweeps.
  bool intervals_are_of_stamps = false;
  /// The last motion was none of the robot: a place was found again, or a prior corrected itself.
  bool has_jumped = false;
  /// What the last scan used of objects that could move, and whether the rest denied it since these
  /// proved to stand.
  MovableUse movable = MovableUse::none;
  bool is_movable_denied = false;
  /// Scans in a row that could not be registered.
  int lost_scans = 0;
  ScanIntervals intervals;
  RegisteredScan last;
  FitStatistics fits;
  FlatFit flat_fit;
  /// Whether scans are registered by surfaces, not by edges and planes of rings.
  bool is_by_surfaces;
  /// The scans that were not.
  RingStart ring_start;
};

}  // namespace stillmap
