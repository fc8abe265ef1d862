#include "core/odometry/scan_features.hpp"

#include <tbb/parallel_invoke.h>

namespace stillmap {
namespace {

/// Objects taller than this are no vehicles or people, whatever their labels say [m].
constexpr float max_object_height_m = 5.0F;

}  // namespace

UsablePoints::UsablePoints(const OdometryConfig& config, const ObjectClusters& objects,
                           const std::vector<MotionClass>& motion_classes, MovableUse movable)
    : semantic_(config.weighting == Weighting::semantic), objects_(objects) {
  if (!semantic_ || !config.motion.use_range_image_history) {
    usable_.assign(objects.count, true);
    return;
  }
  usable_.resize(objects.count);
  for (std::size_t k = 0; k < objects.count; ++k)
    usable_[k] = objects.height_m[k] > max_object_height_m;
  if (movable == MovableUse::none) return;
  for (std::size_t k = 0; k < objects.count; ++k)
    if (motion_classes[k] == MotionClass::parked) usable_[k] = true;
}

FeaturePoint ScanFeatures::point(std::uint32_t i) const {
  const double part = rolling() ? sweep_.part(scan_.time_offset_s[i]) : 0.0;
  const SemanticClass label = labels_.empty() ? SemanticClass::unlabeled : labels_.classes[i];
  return {scan_.points_lidar[i], label, static_cast<float>(part)};
}

FeatureSets ScanFeatures::registered(const UsablePoints& usable) const {
  const auto collect = [&](const std::vector<std::uint32_t>& from, std::vector<FeaturePoint>& to) {
    to.reserve(from.size());
    for (const std::uint32_t i : from)
      if (usable(i)) to.push_back(point(i));
  };
  FeatureSets sets;
  sets.rolling = rolling();
  collect(features_.edges, sets.edges);
  collect(features_.registered_planes, sets.planes);
  collect(features_.surfaces, sets.surfaces);
  for (const std::uint32_t i : features_.upright_points) sets.points.push_back(point(i));
  for (const std::uint32_t i : features_.level_points) sets.level_points.push_back(point(i));
  return sets;
}

FeatureSets ScanFeatures::of_map(const UsablePoints& usable,
                                 const std::vector<Motion>& motion) const {
  const auto collect = [&](const std::vector<std::uint32_t>& from, std::vector<FeaturePoint>& to) {
    to.reserve(from.size());
    for (const std::uint32_t i : from)
      if (usable(i, motion[i])) to.push_back(point(i));
  };
  FeatureSets sets;
  sets.rolling = rolling();
  collect(features_.edges, sets.edges);
  collect(features_.planes, sets.planes);
  sets.points.reserve(features_.points.size());
  for (const std::uint32_t i : features_.points) sets.points.push_back(point(i));
  return sets;
}

FeatureSets downsampled(FeatureSets features) {
  constexpr std::size_t enough = 1000;
  const auto downsample = [](std::vector<FeaturePoint>& points) {
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
                      const Eigen::Isometry3d& T_map_lidar, const PoseTangent& sweep_twist) {
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

}  // namespace stillmap
