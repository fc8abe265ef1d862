#include "core/odometry/odometry.hpp"

#include <tbb/parallel_invoke.h>

#include <cassert>
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
/// After this many lost scans in a row the local map starts anew at the predicted pose.
constexpr int max_lost_scans = 10;

double seconds(std::int64_t ns) { return static_cast<double>(ns) * 1e-9; }

/// The paper's "no weighting" has no robust kernel either.
OdometryConfig without_unused_kernel(OdometryConfig config) {
  if (config.weighting == Weighting::none) config.registration.robust_scale_m = 0.0;
  return config;
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
  return map;
}

SemanticClass label_of(const PointLabels& labels, std::size_t i) {
  return labels.empty() ? SemanticClass::unlabeled : labels.classes[i];
}

/// Points that registration and local map may use: with semantics, a movable point must belong to
/// an object that earlier range images have shown parked (or, without earlier range images, pass
/// eq. (9)).
class UsablePoints {
 public:
  UsablePoints(const OdometryConfig& config, const ObjectClusters& objects,
               const std::vector<MotionClass>& motion_classes)
      : semantic_(config.weighting == Weighting::semantic),
        uses_history_(config.motion.use_range_image_history),
        objects_(objects),
        motion_classes_(motion_classes) {}

  [[nodiscard]] bool operator()(std::size_t i) const {
    const std::int32_t object = objects_.of_point[i];
    if (!semantic_ || object == ObjectClusters::none || !uses_history_) return true;
    return motion_classes_[static_cast<std::size_t>(object)] == MotionClass::parked;
  }
  [[nodiscard]] bool operator()(std::size_t i, Motion motion) const {
    return (*this)(i) && !(semantic_ && motion == Motion::highly_dynamic);
  }

 private:
  bool semantic_;
  bool uses_history_;
  const ObjectClusters& objects_;
  const std::vector<MotionClass>& motion_classes_;
};

FeatureSets feature_sets(const Scan& scan, const PointLabels& labels, const Features& features,
                         const UsablePoints& usable) {
  FeatureSets sets;
  const auto collect = [&](const std::vector<std::uint32_t>& from, std::vector<FeaturePoint>& to) {
    to.reserve(from.size());
    for (const std::uint32_t i : from)
      if (usable(i)) to.push_back({scan.points_lidar[i], label_of(labels, i)});
  };
  collect(features.edges, sets.edges);
  collect(features.registered_planes, sets.planes);
  return sets;
}

void extend_local_map(LocalMap& map, const Scan& scan, const PointLabels& labels,
                      const Features& features, const UsablePoints& usable,
                      const std::vector<Motion>& motion, const Eigen::Isometry3d& T_map_lidar) {
  const Eigen::Isometry3f T = T_map_lidar.cast<float>();
  const auto extend = [&](const std::vector<std::uint32_t>& from, FeatureMap& to) {
    std::vector<LabelledPoint> points;
    points.reserve(from.size());
    for (const std::uint32_t i : from)
      if (usable(i, motion[i])) points.push_back({T * scan.points_lidar[i], label_of(labels, i)});
    to.insert(points);
    to.remove_far_from(T.translation());
  };
  tbb::parallel_invoke([&] { extend(features.edges, map.edges); },
                       [&] { extend(features.planes, map.planes); });
}

}  // namespace

struct Odometry::State {
  State(const OdometryConfig& odometry_config, const SensorModel& sensor_model)
      : config(without_unused_kernel(odometry_config)),
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
  /// Counts lost scans, which stay out of the local map. Clears the map after `max_lost_scans`.
  [[nodiscard]] bool may_extend_map(OdometryHealth health);
  [[nodiscard]] OdometryResult estimate_pose(const FeatureSets& features,
                                             Eigen::Isometry3d T_map_lidar_predicted,
                                             bool prediction_is_good) const;
  void update_state(std::int64_t stamp_ns, std::optional<RangeImageView> view,
                    const Eigen::Isometry3d& T_map_lidar);

  OdometryConfig config;
  SensorModel sensor;
  LocalMap map;
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
  return last_interval_s > 0.0 && lost_scans == 0 &&
         seconds(stamp_ns - last_stamp_ns) <= max_prediction_s;
}

bool Odometry::State::may_extend_map(OdometryHealth health) {
  lost_scans = health == OdometryHealth::lost ? lost_scans + 1 : 0;
  if (lost_scans < max_lost_scans) return lost_scans == 0;
  map.edges.clear();
  map.planes.clear();
  lost_scans = 0;
  return true;
}

OdometryResult Odometry::State::estimate_pose(const FeatureSets& features,
                                              Eigen::Isometry3d T_map_lidar_predicted,
                                              bool prediction_is_good) const {
  if (!started) {
    if (prior_map.empty()) return OdometryResult{.T_map_lidar = T_map_lidar_predicted};
    return relocalize(features, prior_map, map, T_map_lidar_predicted, config);
  }
  if (!prediction_is_good) {
    const LocalMap coarse_map = coarse_map_of_scan(last_features, T_map_lidar);
    T_map_lidar_predicted = register_features(features, coarse_map, T_map_lidar_predicted,
                                              coarse_registration_config(config))
                                .T_map_lidar;
  }
  return register_features(features, map, T_map_lidar_predicted, config);
}

void Odometry::State::update_state(std::int64_t stamp_ns, std::optional<RangeImageView> view,
                                   const Eigen::Isometry3d& T_map_lidar_now) {
  if (started) {
    last_motion = T_map_lidar.inverse() * T_map_lidar_now;
    last_interval_s = seconds(stamp_ns - last_stamp_ns);
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

Odometry::Odometry(const OdometryConfig& config, const SensorModel& sensor)
    : state_(std::make_unique<State>(config, sensor)) {
  if (const std::string faults = config.faults(); !faults.empty())
    throw std::invalid_argument(faults);
}

Odometry::~Odometry() = default;
Odometry::Odometry(Odometry&&) noexcept = default;
Odometry& Odometry::operator=(Odometry&&) noexcept = default;

Eigen::Isometry3d Odometry::predict(std::int64_t stamp_ns) const {
  return state_->T_map_lidar * motion_during(seconds(stamp_ns - state_->last_stamp_ns));
}

Eigen::Isometry3d Odometry::motion_during(double period_s) const {
  if (state_->last_interval_s <= 0.0 || period_s <= 0.0 || period_s > max_prediction_s)
    return Eigen::Isometry3d::Identity();
  return scaled_motion(state_->last_motion, period_s / state_->last_interval_s);
}

Odometry::Step Odometry::register_scan(const Scan& scan, const PointLabels& labels,
                                       const std::optional<Eigen::Isometry3d>& T_map_lidar_prior) {
  assert(labels.empty() || labels.classes.size() == scan.size());
  State& state = *state_;
  const OdometryConfig& config = state.config;
  const Eigen::Isometry3d T_map_lidar_predicted =
      T_map_lidar_prior.value_or(predict(scan.stamp_ns));

  // Features F_e and F_p, without those on objects that may be moving.
  const Features features = extract_features(scan, config.features);
  const ObjectClusters objects =
      cluster_objects(scan.points_lidar, labels.classes, config.motion.object_gap_m);
  auto view = state.view_of(scan, labels, T_map_lidar_predicted);
  const auto motion_classes = state.classify(scan, objects, view, T_map_lidar_predicted);
  const UsablePoints usable(config, objects, motion_classes);
  FeatureSets sets = feature_sets(scan, labels, features, usable);

  // Pose against the local map, eq. (5)-(13).
  Step step;
  const bool prediction_is_good = T_map_lidar_prior || state.has_velocity(scan.stamp_ns);
  step.result = state.estimate_pose(sets, T_map_lidar_predicted, prediction_is_good);
  const Eigen::Isometry3d& T_map_lidar = step.result.T_map_lidar;

  // Moving points stay out of the local map, eq. (9) and c > c_th.
  step.motion =
      classify_point_motion(scan, labels, objects, motion_classes, T_map_lidar, state.map, config);
  if (state.may_extend_map(step.result.health))
    extend_local_map(state.map, scan, labels, features, usable, step.motion, T_map_lidar);
  state.update_state(scan.stamp_ns, std::move(view), T_map_lidar);
  state.last_features = std::move(sets);
  return step;
}

void Odometry::add_prior_map(std::span<const LabelledPoint> points_map) {
  State& state = *state_;
  insert_prior_map(points_map, state.map);
  if (!state.started) state.prior_map.assign(points_map.begin(), points_map.end());
}

void Odometry::reset() { *state_ = State(state_->config, state_->sensor); }

}  // namespace stillmap
