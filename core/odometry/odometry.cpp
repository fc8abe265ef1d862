#include "core/odometry/odometry.hpp"

#include <tbb/parallel_invoke.h>

#include <cassert>
#include <cmath>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "core/odometry/features.hpp"
#include "core/odometry/motion_classification.hpp"
#include "core/odometry/object_clusters.hpp"
#include "core/odometry/registration.hpp"
#include "core/odometry/relocalization.hpp"
#include "core/odometry/se3.hpp"

namespace stillmap {
namespace {

/// Time beyond which the last velocity is not extrapolated [s].
constexpr double max_prediction_s = 1.0;
/// Starts for the motion to the second scan: rings of this many directions [m].
constexpr int first_motion_rings = 4;
constexpr int first_motion_directions = 8;
constexpr double first_motion_spacing_m = 0.75;
constexpr double min_gain_of_other_start = 1.1;
/// After a gap of up to this the lidar may have gone straight on [s].
constexpr double max_gap_s = 10.0;
/// After so many lost scans, and again after as many, the scan is looked for all round.
constexpr int relocalization_interval = 5;
/// The first scans find less of the map with every step: nothing is judged by fewer than these.
constexpr int min_fits_seen = 8;
/// With this share of the usual fit of all its features a scan is believed where little stands up.
constexpr double clear_fit_share = 0.85;
/// A scan of which a smaller share than this lies in known space could lie anywhere.
constexpr double min_believed_overlap = 0.1;
/// A pose whose OdometryResult::upright_fit is a smaller share than this of what they have lately
/// been is not believed. Simulated drives with hard turns fall to 0.58; scans of another city, or
/// of the wrong place in this one, reach 0.32.
constexpr double min_believed_fit_share = 0.5;
/// Share of the running mean of fits below which other starts are tried.
constexpr double min_fit_share = 0.95;
/// Weight of the newest fit in the running mean.
constexpr double fit_mean_gain = 0.1;
/// Weight of the newest stamp in the running mean of their deviations.
constexpr double irregularity_gain = 0.1;
/// A stamp off the sensor's period by more than this share of it is irregular.
constexpr double max_period_deviation = 0.1;
/// Objects are judged again where the registered pose is farther than this from the predicted one
/// [m, rad].
constexpr double judge_again_distance_m = 0.2;
constexpr double judge_again_angle_rad = 0.01;

double seconds(std::int64_t ns) { return static_cast<double>(ns) * 1e-9; }

OdometryConfig as_used(OdometryConfig config) {
  // The paper's "no weighting" has no robust kernel either.
  if (config.weighting == Weighting::none || config.paper_exact)
    config.registration.robust_scale_m = 0.0;
  if (config.paper_exact) config.motion.use_range_image_history = false;
  return config;
}

bool is_registered_by_surfaces(const SensorModel& sensor, const OdometryConfig& config) {
  if (sensor.pattern == ScanPattern::irregular) return true;
  return !config.paper_exact && sensor.rings >= config.features.min_surface_rings;
}

LocalMap coarse_map_of_scan(const FeatureSets& features, const Eigen::Isometry3d& T_map_lidar) {
  LocalMap map = make_coarse_map();
  const Eigen::Isometry3f T = T_map_lidar.cast<float>();
  const auto fill = [&](const std::vector<FeaturePoint>& from, FeatureMap& to) {
    std::vector<LabelledPoint> points;
    points.reserve(from.size());
    for (const FeaturePoint& f : from) points.push_back({T * f.position_lidar, f.label});
    to.insert(points);
  };
  fill(features.edges, map.edges);
  fill(features.planes, map.planes);
  fill(features.surfaces, map.planes);
  return map;
}

SemanticClass label_of(const PointLabels& labels, std::size_t i) {
  return labels.empty() ? SemanticClass::unlabeled : labels.classes[i];
}

void move_points(Scan& scan, const Eigen::Isometry3d& T) {
  const Eigen::Isometry3f T_float = T.cast<float>();
  for (Eigen::Vector3f& point : scan.points_lidar) point = T_float * point;
}

/// Enough features to find a place by.
FeatureSets thinned(FeatureSets features) {
  constexpr std::size_t enough = 1000;
  const auto thin = [](std::vector<FeaturePoint>& points) {
    if (points.size() <= enough) return;
    for (std::size_t k = 0; k < enough; ++k) points[k] = points[k * points.size() / enough];
    points.resize(enough);
  };
  thin(features.edges);
  thin(features.planes);
  thin(features.surfaces);
  return features;
}

/// Which of two poses is the right one: the fit of what stands up, less where little of the scan
/// lies in known space.
double agreement(const OdometryResult& result) {
  constexpr double enough_overlap = 0.5;
  return result.upright_fit * std::min(1.0, result.overlap / enough_overlap);
}

/// Whether two starts have come to the same pose: a worse fit is then the scene's.
bool agree(const OdometryResult& a, const OdometryResult& b) {
  constexpr double max_distance_m = 0.03;
  constexpr double max_angle_rad = 0.003;
  if (a.health == OdometryHealth::lost || b.health == OdometryHealth::lost) return false;
  const PoseTangent difference = boxminus(a.T_map_lidar, b.T_map_lidar);
  return difference.head<3>().norm() < max_distance_m &&
         difference.tail<3>().norm() < max_angle_rad;
}

/// Objects taller than this are no vehicles or people, whatever their labels say [m].
constexpr float max_object_height_m = 5.0F;

std::vector<bool> too_tall_objects(const Scan& scan, const ObjectClusters& objects) {
  std::vector<Eigen::AlignedBox1f> heights(objects.count);
  for (std::size_t i = 0; i < objects.of_point.size(); ++i) {
    if (objects.of_point[i] == ObjectClusters::none) continue;
    heights[static_cast<std::size_t>(objects.of_point[i])].extend(
        Eigen::AlignedBox1f::VectorType(scan.points_lidar[i].z()));
  }
  std::vector<bool> too_tall(objects.count);
  for (std::size_t k = 0; k < objects.count; ++k)
    too_tall[k] = heights[k].sizes()[0] > max_object_height_m;
  return too_tall;
}

/// What registration uses of objects that could move.
enum class MovableUse {
  /// Nothing: an object that stood beside the lidar may set off with it.
  none,
  /// Those that earlier range images have shown parked.
  parked,
};

/// Points that registration and local map may use: with semantics none on objects that could move,
/// or (without earlier range images) those that pass eq. (9).
class UsablePoints {
 public:
  UsablePoints(const OdometryConfig& config, const Scan& scan, const ObjectClusters& objects,
               const std::vector<MotionClass>& motion_classes, MovableUse movable)
      : semantic_(config.weighting == Weighting::semantic), objects_(objects) {
    if (!semantic_ || !config.motion.use_range_image_history) {
      usable_.assign(objects.count, true);
      return;
    }
    usable_ = too_tall_objects(scan, objects);
    if (movable == MovableUse::none) return;
    for (std::size_t k = 0; k < objects.count; ++k)
      if (motion_classes[k] == MotionClass::parked) usable_[k] = true;
  }

  [[nodiscard]] bool operator()(std::size_t i) const {
    const std::int32_t object = objects_.of_point[i];
    return object == ObjectClusters::none || usable_[static_cast<std::size_t>(object)];
  }
  [[nodiscard]] bool operator()(std::size_t i, Motion motion) const {
    return (*this)(i) && !(semantic_ && motion == Motion::highly_dynamic);
  }

 private:
  bool semantic_;
  const ObjectClusters& objects_;
  std::vector<bool> usable_;
};

/// Fewer static features than this are helped out by parked vehicles.
constexpr std::size_t min_static_features = 100;

FeatureSets feature_sets(const Scan& scan, const SweepTimes& sweep, const PointLabels& labels,
                         const Features& features, const UsablePoints& usable) {
  FeatureSets sets;
  sets.rolling = sweep.duration_s > 0.0;
  const auto collect = [&](const std::vector<std::uint32_t>& from, std::vector<FeaturePoint>& to) {
    to.reserve(from.size());
    for (const std::uint32_t i : from) {
      if (!usable(i)) continue;
      const double part = sets.rolling ? sweep.part(scan.time_offset_s[i]) : 0.0;
      to.push_back({scan.points_lidar[i], label_of(labels, i), static_cast<float>(part)});
    }
  };
  collect(features.edges, sets.edges);
  collect(features.registered_planes, sets.planes);
  collect(features.surfaces, sets.surfaces);
  return sets;
}

/// Points that enter the local map. Only edges and planes.
FeatureSets map_features(const Scan& scan, const SweepTimes& sweep, const PointLabels& labels,
                         const Features& features, const UsablePoints& usable,
                         const std::vector<Motion>& motion) {
  FeatureSets sets;
  sets.rolling = sweep.duration_s > 0.0;
  const auto collect = [&](const std::vector<std::uint32_t>& from, std::vector<FeaturePoint>& to) {
    to.reserve(from.size());
    for (const std::uint32_t i : from) {
      if (!usable(i, motion[i])) continue;
      const double part = sets.rolling ? sweep.part(scan.time_offset_s[i]) : 0.0;
      to.push_back({scan.points_lidar[i], label_of(labels, i), static_cast<float>(part)});
    }
  };
  collect(features.edges, sets.edges);
  collect(features.planes, sets.planes);
  return sets;
}

/// Points compensated for `sweep_twist` beyond what they were.
void extend_local_map(LocalMap& map, const FeatureSets& features,
                      const Eigen::Isometry3d& T_map_lidar,
                      const PoseTangent& sweep_twist = PoseTangent::Zero()) {
  const auto extend = [&](const std::vector<FeaturePoint>& from, FeatureMap& to) {
    std::vector<LabelledPoint> points;
    points.reserve(from.size());
    for (const FeaturePoint& f : from) {
      const Eigen::Vector3d p =
          compensated(f.position_lidar.cast<double>(), f.sweep_part, sweep_twist);
      points.push_back({(T_map_lidar * p).cast<float>(), f.label});
    }
    to.insert(points);
    to.remove_far_from(T_map_lidar.translation().cast<float>());
  };
  tbb::parallel_invoke([&] { extend(features.edges, map.edges); },
                       [&] { extend(features.planes, map.planes); });
}

}  // namespace

/// A scan while it is registered.
struct ScanInParts {
  const Scan& scan;
  const SweepTimes& sweep;
  const PointLabels& labels;
  Features features;
  ObjectClusters objects;
  std::optional<RangeImageView> view;
  std::vector<MotionClass> motion_classes;
  SweepPrior sweep_prior;
  MovableUse movable = MovableUse::none;
};

struct Odometry::State {
  State(const OdometryConfig& odometry_config, const SensorModel& sensor_model)
      : config(as_used(odometry_config)),
        sensor(sensor_model),
        map{FeatureMap(odometry_config.local_map), FeatureMap(odometry_config.local_map)},
        history(odometry_config.motion) {}

  /// The range image of the scan for the history; nothing where none is kept.
  [[nodiscard]] std::optional<RangeImageView> view_of(const Scan& scan, const PointLabels& labels,
                                                      const Eigen::Isometry3d& T_map_lidar) const;
  [[nodiscard]] std::vector<MotionClass> classify(const Scan& scan, const ObjectClusters& objects,
                                                  const std::optional<RangeImageView>& now,
                                                  const Eigen::Isometry3d& T_map_lidar) const;
  /// Whether the last velocity predicts the pose of a scan of this time.
  [[nodiscard]] bool has_velocity(std::int64_t stamp_ns) const;
  /// Time since the last pose [s]. Where stamps have come evenly, a single one that does not is
  /// taken for a fault of the clock, and the time for a multiple of the sensor's period.
  [[nodiscard]] double interval_to(std::int64_t stamp_ns) const;
  [[nodiscard]] Eigen::Isometry3d motion_during(double period_s) const;
  /// The IMU's rotation once the first scans have told the velocity; before that the first scan is
  /// straightened without it. The paper has none.
  [[nodiscard]] bool follows(const std::optional<InertialMotion>& inertial) const {
    return inertial && started && !first_scan && !config.paper_exact;
  }
  /// motion_during() since the last pose, turned as the IMU says.
  [[nodiscard]] Eigen::Isometry3d motion_to_middle(
      double interval_s, const std::optional<InertialMotion>& inertial) const;
  /// The motion from the first scan to the second, which may be of any speed up to 30 m/s at 10 Hz.
  [[nodiscard]] OdometryResult search_first_motion(
      const FeatureSets& features, const Eigen::Isometry3d& T_map_lidar_predicted) const;
  [[nodiscard]] FeatureSets registered_features(ScanInParts& parts) const;
  /// Judges what moves at the registered pose where the predicted one was far from it, and
  /// registers again without that.
  void judge_again(ScanInParts& parts, const Eigen::Isometry3d& T_map_lidar_predicted,
                   FeatureSets& features, OdometryResult& result) const;
  /// All starts that may lead to the pose, the cheapest first, until one fits.
  [[nodiscard]] OdometryResult search_pose(const FeatureSets& features,
                                           const Eigen::Isometry3d& T_map_lidar_predicted,
                                           double interval_s, bool prediction_is_good) const;
  /// `interval_s` is the time since the last pose.
  [[nodiscard]] OdometryResult estimate_pose(const FeatureSets& features,
                                             const Eigen::Isometry3d& T_map_lidar_predicted,
                                             double interval_s, bool prediction_is_good) const;
  /// Whether a scan lies as well on the local map as scans have lately.
  [[nodiscard]] bool fits(const OdometryResult& result) const;
  void update_fit(const OdometryResult& result);
  [[nodiscard]] SweepPrior sweep_prior(std::int64_t time_ns, const SweepTimes& sweep,
                                       const SweepMotion& motion) const;
  void extend_map(const ScanInParts& parts, const Step& step,
                  const Eigen::Isometry3d& T_map_middle);
  /// Builds the local map anew from the first scan, compensated for the motion that the second one
  /// shows, and registers that one again; the two converge together. `features` are those of the
  /// second scan, not compensated.
  void straighten_first_scan(const FeatureSets& features, std::int64_t time_ns,
                             const SweepTimes& sweep, OdometryResult& second);
  void update_state(std::int64_t stamp_ns, std::optional<RangeImageView> view,
                    const Eigen::Isometry3d& T_map_lidar);

  OdometryConfig config;
  SensorModel sensor;
  LocalMap map;
  struct FirstScan {
    FeatureSets features;
    SweepTimes sweep;
    Eigen::Isometry3d T_map_stamp;
  };
  /// A first scan that rolled at an unknown velocity, until the second one tells it.
  std::optional<FirstScan> first_scan;
  /// Points of a prior map, until the first scan is registered against it.
  std::vector<LabelledPoint> prior_map;
  RangeImageHistory history;
  bool started = false;
  /// Scans in a row that could not be registered.
  int lost_scans = 0;
  std::int64_t last_stamp_ns = 0;
  Eigen::Isometry3d T_map_lidar = Eigen::Isometry3d::Identity();
  /// The last scan's features, to align the next one coarsely where no velocity is known.
  FeatureSets last_features;
  /// Motion from the last scan but one to the last, and the time between them.
  Eigen::Isometry3d last_motion = Eigen::Isometry3d::Identity();
  double last_interval_s = 0.0;
  /// Running mean of OdometryResult::fit; 0 before the first.
  double mean_fit = 0.0;
  double mean_upright_fit = 0.0;
  /// Scans in these means.
  int fits_seen = 0;
  /// Running mean of the stamps' deviation from multiples of the period, as a share of it.
  double irregularity = 0.0;
};

std::optional<RangeImageView> Odometry::State::view_of(const Scan& scan, const PointLabels& labels,
                                                       const Eigen::Isometry3d& T_map_lidar) const {
  if (labels.empty() || !config.motion.use_range_image_history) return std::nullopt;
  return RangeImageView(scan, labels.classes, sensor, T_map_lidar);
}

std::vector<MotionClass> Odometry::State::classify(const Scan& scan, const ObjectClusters& objects,
                                                   const std::optional<RangeImageView>& now,
                                                   const Eigen::Isometry3d& T_map_lidar) const {
  if (!now) return std::vector<MotionClass>(objects.count, MotionClass::undecided);
  return classify_motion(scan, objects, T_map_lidar, history, *now, config.motion);
}

bool Odometry::State::has_velocity(std::int64_t stamp_ns) const {
  return last_interval_s > 0.0 && lost_scans == 0 && interval_to(stamp_ns) <= max_prediction_s;
}

double Odometry::State::interval_to(std::int64_t stamp_ns) const {
  const double interval_s = seconds(stamp_ns - last_stamp_ns);
  const double periods = std::round(interval_s / sensor.period_s);
  if (irregularity > max_period_deviation || periods > 10.0) return interval_s;
  return std::max(1.0, periods) * sensor.period_s;
}

Eigen::Isometry3d Odometry::State::motion_during(double period_s) const {
  if (last_interval_s <= 0.0 || period_s <= 0.0 || period_s > max_prediction_s)
    return Eigen::Isometry3d::Identity();
  return scaled_motion(last_motion, period_s / last_interval_s);
}

Eigen::Isometry3d Odometry::State::motion_to_middle(
    double interval_s, const std::optional<InertialMotion>& inertial) const {
  const Eigen::Isometry3d T_last_middle = motion_during(interval_s);
  if (!follows(inertial)) return T_last_middle;
  PoseTangent twist = twist_of(T_last_middle);
  twist.tail<3>() = so3_log(inertial->R_last_middle);
  return motion_of(twist);
}

bool Odometry::State::fits(const OdometryResult& result) const {
  return result.health != OdometryHealth::lost && result.fit >= min_fit_share * mean_fit;
}

OdometryResult Odometry::State::estimate_pose(const FeatureSets& features,
                                              const Eigen::Isometry3d& T_map_lidar_predicted,
                                              double interval_s, bool prediction_is_good) const {
  if (!started) {
    if (prior_map.empty()) return OdometryResult{.T_map_lidar = T_map_lidar_predicted};
    return relocalize(features, prior_map, map, T_map_lidar_predicted, config);
  }
  OdometryResult found =
      search_pose(features, T_map_lidar_predicted, interval_s, prediction_is_good);
  const bool is_believed = fits_seen < min_fits_seen ||
                           ((found.upright_fit >= min_believed_fit_share * mean_upright_fit ||
                             found.fit >= clear_fit_share * mean_fit) &&
                            found.overlap >= min_believed_overlap);
  if (found.health != OdometryHealth::lost && is_believed) return found;
  if (lost_scans % relocalization_interval == relocalization_interval - 1) {
    std::vector<LabelledPoint> points_map = map.edges.points();
    const std::vector<LabelledPoint> planes_map = map.planes.points();
    points_map.insert(points_map.end(), planes_map.begin(), planes_map.end());
    const OdometryResult again =
        relocalize(thinned(features), points_map, map, T_map_lidar_predicted, config);
    if (again.upright_fit >= min_believed_fit_share * mean_upright_fit) return again;
  }
  return lost_at(T_map_lidar_predicted);
}

OdometryResult Odometry::State::search_pose(const FeatureSets& features,
                                            const Eigen::Isometry3d& T_map_lidar_predicted,
                                            double interval_s, bool prediction_is_good) const {
  OdometryResult best = lost_at(T_map_lidar_predicted);
  int iterations = 0;
  const auto take_better = [&](const OdometryResult& other) {
    iterations += other.iterations;
    const bool is_found = other.health != OdometryHealth::lost;
    const bool is_better =
        best.health == OdometryHealth::lost || agreement(other) > agreement(best);
    if (is_found && is_better) best = other;
    best.iterations = iterations;
    return fits(best);
  };
  if (prediction_is_good) {
    const OdometryResult direct = register_features(features, map, T_map_lidar_predicted, config);
    if (take_better(direct) || config.paper_exact) return best;
    const OdometryResult wide =
        register_in_two_stages(features, map, T_map_lidar_predicted, config);
    if (take_better(wide) || agree(direct, wide)) return best;
    // The motion of the last scan whatever the stamps say, and none.
    for (const Eigen::Isometry3d& T : {Eigen::Isometry3d(T_map_lidar * last_motion), T_map_lidar}) {
      if (take_better(register_in_two_stages(features, map, T, config))) return best;
    }
  }
  if (last_interval_s <= 0.0 && !config.paper_exact)
    return search_first_motion(features, T_map_lidar_predicted);
  const LocalMap coarse_map = coarse_map_of_scan(last_features, T_map_lidar);
  std::vector<Eigen::Isometry3d> starts{T_map_lidar_predicted};
  if (lost_scans > 0 || interval_s > max_prediction_s) {
    starts.push_back(T_map_lidar);
    // Straight on during a gap.
    if (last_interval_s > 0.0 && interval_s > 0.0 && interval_s < max_gap_s)
      starts.push_back(T_map_lidar * scaled_motion(last_motion, interval_s / last_interval_s));
  }
  for (const Eigen::Isometry3d& T : starts) {
    const OdometryResult coarse =
        register_features(features, coarse_map, T, coarse_registration_config(config));
    if (take_better(register_in_two_stages(features, map, coarse.T_map_lidar, config))) break;
    if (starts.size() > 1 && take_better(register_in_two_stages(features, map, T, config))) break;
  }
  return best;
}

OdometryResult Odometry::State::search_first_motion(
    const FeatureSets& features, const Eigen::Isometry3d& T_map_lidar_predicted) const {
  const LocalMap coarse_map = coarse_map_of_scan(last_features, T_map_lidar);
  const Eigen::Isometry3d T_coarse = register_features(features, coarse_map, T_map_lidar_predicted,
                                                       coarse_registration_config(config))
                                         .T_map_lidar;
  OdometryResult best = register_in_two_stages(features, map, T_coarse, config);
  // Other starts must be clearly better: streets look alike a few metres on, and where no structure
  // shows the motion along them all places fit.
  const FeatureSets some = thinned(features);
  const auto try_from = [&](const Eigen::Isometry3d& T) {
    const OdometryResult other = register_in_two_stages(some, map, T, config);
    const bool is_clear = other.health == OdometryHealth::good &&
                          agreement(other) > min_gain_of_other_start * agreement(best);
    if (is_clear) best = other;
  };
  try_from(T_map_lidar_predicted);
  for (int ring = 1; ring <= first_motion_rings; ++ring) {
    for (int k = 0; k < first_motion_directions; ++k) {
      const double bearing = 2.0 * std::numbers::pi * k / first_motion_directions;
      const double distance_m = ring * first_motion_spacing_m;
      try_from(T_map_lidar_predicted * Eigen::Translation3d(distance_m * std::cos(bearing),
                                                            distance_m * std::sin(bearing), 0.0));
    }
  }
  if (best.health == OdometryHealth::lost) return lost_at(T_map_lidar_predicted);
  return register_features(features, map, best.T_map_lidar, config, best.sweep_correction);
}

FeatureSets Odometry::State::registered_features(ScanInParts& parts) const {
  const auto collected = [&] {
    const UsablePoints usable(config, parts.scan, parts.objects, parts.motion_classes,
                              parts.movable);
    FeatureSets sets = feature_sets(parts.scan, parts.sweep, parts.labels, parts.features, usable);
    sets.sweep_prior = parts.sweep_prior;
    return sets;
  };
  FeatureSets sets = collected();
  if (sets.edges.size() + sets.planes.size() + sets.surfaces.size() >= min_static_features)
    return sets;
  parts.movable = MovableUse::parked;
  return collected();
}

void Odometry::State::judge_again(ScanInParts& parts,
                                  const Eigen::Isometry3d& T_map_lidar_predicted,
                                  FeatureSets& features, OdometryResult& result) const {
  if (!parts.view || !started || result.health == OdometryHealth::lost) return;
  const PoseTangent off = boxminus(result.T_map_lidar, T_map_lidar_predicted);
  if (off.head<3>().norm() < judge_again_distance_m && off.tail<3>().norm() < judge_again_angle_rad)
    return;
  parts.view->move_to(result.T_map_lidar);
  parts.motion_classes = classify(parts.scan, parts.objects, parts.view, result.T_map_lidar);
  if (parts.movable == MovableUse::none) return;
  features = registered_features(parts);
  const OdometryResult again =
      register_features(features, map, result.T_map_lidar, config, result.sweep_correction);
  if (again.health != OdometryHealth::lost) result = again;
}

void Odometry::State::update_state(std::int64_t stamp_ns, std::optional<RangeImageView> view,
                                   const Eigen::Isometry3d& T_map_lidar_now) {
  if (started) {
    last_motion = T_map_lidar.inverse() * T_map_lidar_now;
    const double periods = seconds(stamp_ns - last_stamp_ns) / sensor.period_s;
    const double deviation = std::min(1.0, std::abs(periods - std::round(periods)));
    last_interval_s = interval_to(stamp_ns);
    irregularity += irregularity_gain * (deviation - irregularity);
  }
  started = true;
  prior_map = {};
  last_stamp_ns = stamp_ns;
  T_map_lidar = T_map_lidar_now;
  if (!view) return;
  view->move_to(T_map_lidar);
  const auto is_gone = [&](const Eigen::Vector3f& p_map) {
    return history.sees_through(*view, p_map);
  };
  map.edges.remove_movable_if(is_gone);
  map.planes.remove_movable_if(is_gone);
  history.add(*std::move(view));
}

void Odometry::State::straighten_first_scan(const FeatureSets& features, std::int64_t time_ns,
                                            const SweepTimes& sweep, OdometryResult& second) {
  constexpr int rounds = 4;
  const FirstScan first = *std::exchange(first_scan, std::nullopt);
  const double interval_s = seconds(time_ns - last_stamp_ns);
  if (second.health == OdometryHealth::lost || interval_s > max_prediction_s || !features.rolling)
    return;
  OdometryResult found = second;
  FeatureSets moving = features;
  for (int round = 0; round < rounds; ++round) {
    const PoseTangent velocity = twist_of(T_map_lidar.inverse() * found.T_map_lidar) / interval_s;
    T_map_lidar = first.T_map_stamp * motion_of(velocity * first.sweep.middle_s);
    map.edges.clear();
    map.planes.clear();
    extend_local_map(map, first.features, T_map_lidar, velocity * first.sweep.duration_s);
    moving.sweep_prior.T_map_lidar_last = T_map_lidar;
    found = register_features(moving, map, T_map_lidar * motion_of(velocity * interval_s), config,
                              velocity * sweep.duration_s);
    if (found.health == OdometryHealth::lost) return;
  }
  second = found;
}

SweepPrior Odometry::State::sweep_prior(std::int64_t time_ns, const SweepTimes& sweep,
                                        const SweepMotion& motion) const {
  SweepPrior prior;
  if (!started) return prior;
  prior.T_map_lidar_last = T_map_lidar;
  const double interval_s = interval_to(time_ns);
  if (interval_s > 0.0 && interval_s < max_prediction_s)
    prior.duration_share = std::min(1.0, sweep.duration_s / interval_s);
  prior.compensated = motion.twist();
  prior.rotation_is_measured = motion.rotation_is_measured();
  return prior;
}

void Odometry::State::extend_map(const ScanInParts& parts, const Step& step,
                                 const Eigen::Isometry3d& T_map_middle) {
  const UsablePoints usable(config, parts.scan, parts.objects, parts.motion_classes, parts.movable);
  FeatureSets features =
      map_features(parts.scan, parts.sweep, parts.labels, parts.features, usable, step.motion);
  extend_local_map(map, features, T_map_middle);
  if (step.result.health == OdometryHealth::initialised && features.rolling)
    first_scan = {std::move(features), parts.sweep, T_map_middle};
}

void Odometry::State::update_fit(const OdometryResult& result) {
  if (result.health == OdometryHealth::lost || result.health == OdometryHealth::initialised) return;
  ++fits_seen;
  const double gain = std::max(fit_mean_gain, 1.0 / fits_seen);
  const auto update = [gain](double& mean, double value) { mean += gain * (value - mean); };
  update(mean_fit, result.fit);
  update(mean_upright_fit, result.upright_fit);
}

Odometry::Odometry(const OdometryConfig& config, const SensorModel& sensor)
    : state_(std::make_unique<State>(config, sensor)) {
  if (const std::string faults = config.faults(); !faults.empty())
    throw std::invalid_argument(faults);
}

Odometry::~Odometry() = default;
Odometry::Odometry(Odometry&&) noexcept = default;
Odometry& Odometry::operator=(Odometry&&) noexcept = default;

Eigen::Isometry3d Odometry::predict(std::int64_t stamp_ns,
                                    const std::optional<InertialMotion>& inertial) const {
  const double interval_s = seconds(stamp_ns - state_->last_stamp_ns);
  return state_->T_map_lidar * state_->motion_to_middle(interval_s, inertial);
}

SweepMotion Odometry::sweep_motion(const SweepTimes& sweep,
                                   const std::optional<InertialMotion>& inertial) const {
  const Eigen::Isometry3d T_start_end = motion_during(sweep.duration_s);
  if (!state_->follows(inertial)) return SweepMotion(T_start_end);
  return {twist_of(T_start_end).head<3>(), inertial->R_middle_at};
}

Eigen::Isometry3d Odometry::motion_during(double period_s) const {
  return state_->motion_during(period_s);
}

Odometry::Step Odometry::register_scan(Scan& scan, const SweepTimes& sweep,
                                       const PointLabels& labels,
                                       const std::optional<Eigen::Isometry3d>& T_map_lidar_prior,
                                       const std::optional<InertialMotion>& inertial) {
  assert(labels.empty() || labels.classes.size() == scan.size());
  State& state = *state_;
  const OdometryConfig& config = state.config;
  const std::int64_t time_ns = scan.stamp_ns + std::llround(sweep.middle_s * 1e9);
  const SweepMotion expected_motion = sweep_motion(sweep, inertial);
  const double stamp_part = sweep.duration_s > 0.0 ? -sweep.middle_s / sweep.duration_s : 0.0;
  const Eigen::Isometry3d T_map_lidar_predicted =
      T_map_lidar_prior
          ? *T_map_lidar_prior * expected_motion.T_middle_at(stamp_part).inverse()
          : state.T_map_lidar * state.motion_to_middle(state.interval_to(time_ns), inertial);

  // Features F_e and F_p, without those on objects that may be moving.
  ScanInParts parts{.scan = scan, .sweep = sweep, .labels = labels};
  parts.features = is_registered_by_surfaces(state.sensor, config)
                       ? extract_surfaces(scan, config.features)
                       : extract_features(scan, config.features);
  parts.objects = cluster_objects(scan.points_lidar, labels.classes, config.motion.object_gap_m);
  parts.view = state.view_of(scan, labels, T_map_lidar_predicted);
  parts.motion_classes = state.classify(scan, parts.objects, parts.view, T_map_lidar_predicted);
  parts.sweep_prior = state.sweep_prior(time_ns, sweep, expected_motion);
  FeatureSets features = state.registered_features(parts);

  // Pose against the local map, eq. (5)-(13), at the middle of the sweep.
  Step step;
  const bool prediction_is_good = T_map_lidar_prior || state.has_velocity(time_ns);
  step.result = state.estimate_pose(features, T_map_lidar_predicted, state.interval_to(time_ns),
                                    prediction_is_good);
  state.judge_again(parts, T_map_lidar_predicted, features, step.result);
  if (state.first_scan) state.straighten_first_scan(features, time_ns, sweep, step.result);
  const Eigen::Isometry3d T_map_middle = step.result.T_map_lidar;
  const Eigen::Isometry3d T_correction = motion_of(step.result.sweep_correction);
  deskew_to_middle(scan, sweep, T_correction);

  step.T_map_lidar_middle = T_map_middle;

  // Moving points stay out of the local map, eq. (9) and c > c_th.
  step.motion = classify_point_motion(scan, labels, parts.objects, parts.motion_classes,
                                      T_map_middle, state.map, config);
  if (step.result.health == OdometryHealth::lost) {
    state.lost_scans += 1;
  } else {
    state.lost_scans = 0;
    state.extend_map(parts, step, T_map_middle);
    state.update_fit(step.result);
    state.update_state(time_ns, std::move(parts.view), T_map_middle);
    state.last_features = std::move(features);
  }

  // What users see is at the stamp.
  if (sweep.middle_s != 0.0) {
    const Eigen::Isometry3d T_middle_stamp =
        scaled_motion(T_correction, stamp_part) * expected_motion.T_middle_at(stamp_part);
    move_points(scan, T_middle_stamp.inverse());
    step.result.T_map_lidar = T_map_middle * T_middle_stamp;
  }
  scan.time_offset_s.clear();
  return step;
}

void Odometry::add_prior_map(std::span<const LabelledPoint> points_map) {
  State& state = *state_;
  insert_prior_map(points_map, state.map);
  if (!state.started) state.prior_map.assign(points_map.begin(), points_map.end());
}

void Odometry::reset() { *state_ = State(state_->config, state_->sensor); }

}  // namespace stillmap
