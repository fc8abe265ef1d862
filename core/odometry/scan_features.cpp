#include "core/odometry/scan_features.hpp"

#include <tbb/parallel_invoke.h>

#include <Eigen/Eigenvalues>
#include <algorithm>

#include "core/odometry/ring_tangents.hpp"

namespace stillmap {
namespace {

/// Objects taller than this are no vehicles or people, and longer ones no cars but walls, or cars
/// that are parked in a row, whatever their labels say [m].
constexpr float max_object_height_m = 5.0F;
constexpr float max_car_length_m = 15.0F;

/// Fewer static features than this are helped out by parked vehicles.
constexpr std::size_t min_static_features = 100;

/// Of what stands up, or lies on the ground, and was not seen moving: below this share of what
/// could not move, objects that could are used, too, and no longer above the other one. Car parks
/// leave 0.03 to 0.18, a jam of lorries between rails and trees 0.33, streets full of traffic 0.57.
constexpr double min_share_left = 0.25;
constexpr double enough_share_left = 0.4;
/// The same of what tells the position along the direction in which what could not move tells
/// least: beside a long wall cars alone may. Car parks before a hall leave 0.11 to 0.28, streets
/// full of traffic 0.5 and more.
constexpr double min_directed_share_left = 0.3;
constexpr double enough_directed_share_left = 0.45;
/// Not asked where what could move is a smaller share of what stands up.
constexpr double min_share_movable = 0.2;

/// Of fewer that count, no share tells [points].
constexpr std::size_t min_telling_points = 30;

bool may_be_used(MotionClass motion, MovableUse use) {
  if (use == MovableUse::not_moving) return motion != MotionClass::moving;
  return use == MovableUse::parked && motion == MotionClass::parked;
}

/// Points that registration and local map may use.
class UsablePoints {
 public:
  /// `parts` must outlive this.
  UsablePoints(const ScanInParts& parts, MovableUse use, const OdometryConfig& config)
      : semantic_(config.weighting == Weighting::semantic), objects_(parts.objects) {
    if (!semantic_ || !config.motion.use_range_image_history) {
      usable_.assign(objects_.count, true);
      return;
    }
    usable_.resize(objects_.count);
    for (std::size_t k = 0; k < objects_.count; ++k) {
      const bool is_fixture = objects_.height_m[k] > max_object_height_m ||
                              (objects_.is_car[k] && objects_.length_m[k] > max_car_length_m);
      usable_[k] = is_fixture || may_be_used(parts.motion_classes[k], use);
    }
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

/// Makes feature points of a scan's points. Eq. (9) knows no confidence.
class FeaturePoints {
 public:
  /// `parts` must outlive this.
  FeaturePoints(const ScanInParts& parts, const OdometryConfig& config)
      : parts_(parts),
        counts_confidence_(!config.paper_exact && !parts.labels.confidence.empty()) {}

  [[nodiscard]] bool rolling() const { return parts_.sweep.duration_s > 0.0; }
  [[nodiscard]] FeaturePoint operator()(std::uint32_t i) const {
    FeaturePoint point{.position_lidar = parts_.scan.points_lidar[i]};
    if (!parts_.labels.empty()) point.label = parts_.labels.classes[i];
    // Written so that NaN is 0.
    if (counts_confidence_)
      point.confidence = std::min(std::max(0.0F, parts_.labels.confidence[i]), 1.0F);
    if (rolling())
      point.sweep_part = static_cast<float>(parts_.sweep.part(parts_.scan.time_offset_s[i]));
    if (!parts_.features.is_level.empty()) point.is_level = parts_.features.is_level[i];
    if (!parts_.features.tangents.empty()) point.tangent_lidar = parts_.features.tangents[i];
    return point;
  }
  /// Those of `indices` for which `is_used(i)` holds.
  template <typename IsUsed>
  [[nodiscard]] std::vector<FeaturePoint> of(const std::vector<std::uint32_t>& indices,
                                             IsUsed is_used) const {
    std::vector<FeaturePoint> points;
    points.reserve(indices.size());
    for (const std::uint32_t i : indices)
      if (is_used(i)) points.push_back((*this)(i));
    return points;
  }

 private:
  const ScanInParts& parts_;
  bool counts_confidence_;
};

bool all_points(std::uint32_t) { return true; }

FeatureSets usable_features(const ScanInParts& parts, MovableUse use,
                            const OdometryConfig& config) {
  const UsablePoints usable(parts, use, config);
  const FeaturePoints points(parts, config);
  std::vector<FeaturePoint> upright = points.of(parts.features.upright_points, all_points);
  if (!parts.features.point_tangents.empty())
    for (std::size_t k = 0; k < upright.size(); ++k)
      upright[k].tangent_lidar = parts.features.point_tangents[parts.features.upright_points[k]];
  // Points that are not measured in rows do not take the pitch along, nor do edges and planes of
  // single rings: these keep what holds them up.
  const bool has_rows =
      !parts.scan.ring.empty() && !parts.features.surfaces.empty() && !config.paper_exact;
  return {.edges = points.of(parts.features.edges, usable),
          .planes = points.of(parts.features.registered_planes, usable),
          .surfaces = points.of(parts.features.surfaces, usable),
          .points = std::move(upright),
          .level_points = points.of(parts.features.level_points, all_points),
          .rolling = points.rolling(),
          .sweep_prior = parts.sweep_prior,
          .sparse_rings = parts.sparse_rings,
          .balance = has_rows ? parts.features.balance : 1.0};
}

/// What a point of something that stands up tells of the horizontal position: across a wall, along
/// whose `tangent_lidar` its ring goes on, and half as much along any direction where it does not
/// go straight on.
Eigen::Matrix2d horizontal_information(const Eigen::Vector3f& tangent_lidar) {
  constexpr double min_length = 0.3;
  const Eigen::Vector2d along = tangent_lidar.head<2>().cast<double>();
  if (along.norm() < min_length) return 0.5 * Eigen::Matrix2d::Identity();
  const Eigen::Vector2d normal = Eigen::Vector2d(-along.y(), along.x()).normalized();
  return normal * normal.transpose();
}

/// Which share of what tells the position is left without what could move, along the direction in
/// which least is, 0..1; 1 where the upright tangents are not known.
double least_share_left(const ScanInParts& parts, const OdometryConfig& config) {
  if (parts.upright_tangents.empty()) return 1.0;
  const UsablePoints fixed(parts, MovableUse::none, config);
  const UsablePoints not_moving(parts, MovableUse::not_moving, config);
  Eigen::Matrix2d left = Eigen::Matrix2d::Zero();
  Eigen::Matrix2d all = Eigen::Matrix2d::Zero();
  for (const std::uint32_t i : parts.features.upright_points) {
    if (!not_moving(i) || is_ground(parts.labels.classes[i])) continue;
    if (parts.scan.points_lidar[i].norm() > parts.surfaces_reach_m) continue;
    const Eigen::Matrix2d information = horizontal_information(parts.upright_tangents[i]);
    all += information;
    if (fixed(i)) left += information;
  }
  const Eigen::Vector2d weakest =
      Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(left).eigenvectors().col(0);
  const double told = weakest.dot(all * weakest);
  return told < static_cast<double>(min_telling_points) ? 1.0 : weakest.dot(left * weakest) / told;
}

/// Whether without what could move hardly anything that stands up would be left, or of the ground,
/// as in a car park, or where labels are wrong about all houses or the road.
bool is_little_left(const ScanInParts& parts, const OdometryConfig& config) {
  if (parts.labels.empty() || config.paper_exact) return false;
  const double min_share =
      parts.movable == MovableUse::not_moving ? enough_share_left : min_share_left;
  const UsablePoints fixed(parts, MovableUse::none, config);
  const UsablePoints not_moving(parts, MovableUse::not_moving, config);
  const auto is_left_out = [&](const std::vector<std::uint32_t>& points, bool counts_ground) {
    std::size_t all = 0;
    std::size_t left = 0;
    for (const std::uint32_t i : points) {
      if (!not_moving(i) || (!counts_ground && is_ground(parts.labels.classes[i]))) continue;
      // Houses far behind a car park are many points that nothing can be registered on.
      if (parts.scan.points_lidar[i].norm() > parts.surfaces_reach_m) continue;
      ++all;
      left += fixed(i) ? 1 : 0;
    }
    return all >= min_telling_points &&
           static_cast<double>(left) < min_share * static_cast<double>(all);
  };
  const double min_directed_share = parts.movable == MovableUse::not_moving
                                        ? enough_directed_share_left
                                        : min_directed_share_left;
  // Under a car the ground seems to stand up, too.
  return least_share_left(parts, config) < min_directed_share ||
         is_left_out(parts.features.upright_points, /*counts_ground=*/false) ||
         is_left_out(parts.features.level_points, /*counts_ground=*/true);
}

}  // namespace

void find_upright_tangents(ScanInParts& parts, const OdometryConfig& config) {
  parts.upright_tangents.clear();
  if (parts.scan.ring.empty() || parts.labels.empty() || config.paper_exact) return;
  const UsablePoints fixed(parts, MovableUse::none, config);
  const auto& upright = parts.features.upright_points;
  const auto movable = std::ranges::count_if(upright, [&](std::uint32_t i) { return !fixed(i); });
  if (static_cast<double>(movable) >= min_share_movable * static_cast<double>(upright.size()))
    parts.upright_tangents = ring_tangents(parts.scan, upright);
}

FeatureSets registered_features(ScanInParts& parts, const OdometryConfig& config) {
  if (!is_little_left(parts, config)) return fixed_or_parked_features(parts, config);
  parts.movable = MovableUse::not_moving;
  return usable_features(parts, parts.movable, config);
}

FeatureSets fixed_or_parked_features(ScanInParts& parts, const OdometryConfig& config) {
  parts.movable = MovableUse::none;
  FeatureSets sets = usable_features(parts, parts.movable, config);
  if (sets.edges.size() + sets.planes.size() + sets.surfaces.size() >= min_static_features)
    return sets;
  parts.movable = MovableUse::parked;
  return usable_features(parts, parts.movable, config);
}

FeatureSets fixed_features(const ScanInParts& parts, const OdometryConfig& config) {
  return usable_features(parts, MovableUse::none, config);
}

double parked_share(const ScanInParts& parts) {
  std::size_t all = 0;
  std::size_t parked = 0;
  for (const std::uint32_t i : parts.features.upright_points) {
    const std::int32_t object = parts.objects.of_point[i];
    if (object == ObjectClusters::none) continue;
    const MotionClass motion = parts.motion_classes[static_cast<std::size_t>(object)];
    all += motion != MotionClass::moving ? 1 : 0;
    parked += motion == MotionClass::parked ? 1 : 0;
  }
  return all == 0 ? 0.0 : static_cast<double>(parked) / static_cast<double>(all);
}

FeatureSets map_features(const ScanInParts& parts, const std::vector<Motion>& motion,
                         const OdometryConfig& config) {
  const UsablePoints usable(parts, parts.movable, config);
  const FeaturePoints points(parts, config);
  const auto stands = [&](std::uint32_t i) { return usable(i, motion[i]); };
  FeatureSets sets;
  sets.edges = points.of(parts.features.edges, stands);
  sets.planes = points.of(parts.features.planes, stands);
  sets.points = points.of(parts.features.points, all_points);
  sets.rolling = points.rolling();
  sets.sparse_rings = parts.sparse_rings;
  return sets;
}

FeatureSets downsampled(FeatureSets features, std::size_t enough) {
  const auto downsample = [enough](std::vector<FeaturePoint>& points) {
    if (points.size() <= enough) return;
    for (std::size_t k = 0; k < enough; ++k) points[k] = points[k * points.size() / enough];
    points.resize(enough);
  };
  downsample(features.edges);
  downsample(features.planes);
  downsample(features.surfaces);
  return features;
}

void extend_local_map(LocalMap& map, const FeatureSets& features,
                      const Eigen::Isometry3d& T_map_lidar, const SweepCorrection& motion) {
  const auto extend = [&](const std::vector<FeaturePoint>& from, FeatureMap& to) {
    std::vector<LabelledPoint> points;
    points.reserve(from.size());
    for (const FeaturePoint& f : from) {
      const Eigen::Vector3d p = compensated(f.position_lidar.cast<double>(), f.sweep_part, motion);
      points.push_back({(T_map_lidar * p).cast<float>(), f.label});
    }
    to.insert(points);
    to.remove_far_from(T_map_lidar.translation().cast<float>());
  };
  tbb::parallel_invoke([&] { extend(features.edges, map.edges); },
                       [&] { extend(features.planes, map.planes); },
                       [&] { extend(features.points, map.points); });
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

std::size_t movable_points(const FeatureSets& features) {
  return static_cast<std::size_t>(std::ranges::count_if(
      features.points, [](const FeaturePoint& point) { return is_movable(point.label); }));
}

bool labels_tell_enough(const FeatureSets& features, const OdometryConfig& config) {
  constexpr std::size_t min_points = 100;
  return config.weighting == Weighting::semantic &&
         features.points.size() >= min_points + movable_points(features);
}

}  // namespace stillmap
