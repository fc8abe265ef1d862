#include "core/localization/pose_evidence.hpp"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/odometry/faint_shifts.hpp"
#include "core/odometry/point_alignment.hpp"
#include "core/odometry/rigid_registration.hpp"

namespace stillmap {
namespace {

/// A point lies on the map when a point of it is as near as this [m].
constexpr float max_distance_m = 0.35F;
/// What of the scan is asked for is as near as this [m]: farther off a map is thin.
constexpr float explained_range_m = 40.0F;
/// What is higher is hardly traffic [m]; so many points of that tell a place by themselves.
constexpr float max_traffic_height_m = 2.5F;
constexpr int min_high_points = 80;
/// Points lie close to the map as near as this [m]: its own voxels, as far as noise lets them.
constexpr float close_distance_m = 0.15F;
/// What of the map is so near [m] was seen together with what would be there.
constexpr float beside_m = 1.0F;
/// What is high tells whether it agrees from so many points on, of the scan and of the map.
constexpr int min_telling_scan_points = 60;
constexpr int min_telling_map_points = 300;
/// A level point when the map's height differs by less [m].
constexpr float max_level_distance_m = 0.25F;
constexpr float ground_search_m = 0.6F;
/// What of the map should be seen is as near as this [m].
constexpr float visible_range_m = 35.0F;
/// Ground is not asked for: beams graze it.
constexpr float min_height_above_ground_m = 0.6F;
/// Where the ground is not known, all of the map is asked for.
constexpr float any_height_m = 1.0F;

LocalMapConfig map_config() {
  return {
      .voxel_size_m = 1.0, .max_points_per_voxel = 32, .min_spacing_m = 0.15, .radius_m = 1000.0};
}

/// Surfaces move a pose that points found by less [m, rad].
constexpr double max_way_m = 1.5;
constexpr double max_way_rad = 0.1;

double share(int part, int whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0.0;
}

/// Whether the voxel would be looked for: it stands up, or would if it has no class.
bool is_expected(const LabelledPoint& point, float height_over_ground_m) {
  if (point.label != SemanticClass::unlabeled)
    return !is_ground(point.label) && !is_movable(point.label);
  return height_over_ground_m > min_height_above_ground_m;
}

}  // namespace

MapSurroundings::MapSurroundings(std::span<const LabelledPoint> points_map)
    : points_map_(points_map), map_(map_config()) {
  map_.planes.insert(points_map);
}

Eigen::Isometry3d MapSurroundings::align(const LocalizationQuery& query,
                                         const Eigen::Isometry3d& T_map_upright) const {
  const PointAlignmentConfig rough{.max_distance_m = 1.0, .kernel_m = 0.5, .max_iterations = 15};
  const PointAlignmentConfig fine{.max_distance_m = 0.5, .kernel_m = 0.15, .max_iterations = 20};
  const Eigen::Isometry3d T =
      align_points(query.features_upright, map_.planes, T_map_upright, {}, rough).T_map_lidar;
  return align_points(query.features_upright, map_.planes, T, {}, fine).T_map_lidar;
}

std::optional<SurfacePose> MapSurroundings::align_surfaces(
    const LocalizationQuery& query, const Eigen::Isometry3d& T_map_upright) const {
  const OdometryConfig config = rigid_registration();
  const OdometryResult wide =
      register_features(query.features_upright, map_, T_map_upright, wide_rigid_registration());
  if (wide.health == OdometryHealth::lost) return std::nullopt;
  const OdometryResult found =
      register_features(query.features_upright, map_, wide.T_map_lidar, config);
  if (found.health == OdometryHealth::lost) return std::nullopt;
  const Eigen::Isometry3d way = T_map_upright.inverse() * found.T_map_lidar;
  const bool is_elsewhere =
      way.translation().norm() > max_way_m || Eigen::AngleAxisd(way.linear()).angle() > max_way_rad;
  const OdometryResult judged =
      doubted_where_shift_fits(found, query.features_upright, map_, config);
  return SurfacePose{found.T_map_lidar, judged.health != OdometryHealth::good, is_elsewhere};
}

PoseEvidence MapSurroundings::evidence(const LocalizationQuery& query,
                                       const Eigen::Isometry3d& T_map_upright) const {
  const Eigen::Isometry3f T = T_map_upright.cast<float>();
  PoseEvidence evidence;
  ask_map(query, T, evidence);
  ask_ground(query, T, evidence);
  ask_scan(query, T, evidence);
  return evidence;
}

void MapSurroundings::ask_map(const LocalizationQuery& query, const Eigen::Isometry3f& T,
                              PoseEvidence& evidence) const {
  const Eigen::Isometry3f T_foot_upright = query.T_foot_upright.cast<float>();
  int explained = 0;
  int close = 0;
  int high_points = 0;
  int high_explained = 0;
  int high_beside = 0;
  for (const FeaturePoint& point : query.features_upright.points) {
    if (point.position_lidar.norm() > explained_range_m) continue;
    const Eigen::Vector3f p = T * point.position_lidar;
    const Neighbours near = map_.planes.nearest(p, 1, max_distance_m);
    const bool is_explained = near.count > 0;
    ++evidence.scan_points;
    explained += is_explained ? 1 : 0;
    close += is_explained && near.squared_distance[0] < close_distance_m * close_distance_m ? 1 : 0;
    if (!query.has_ground || (T_foot_upright * point.position_lidar).z() <= max_traffic_height_m)
      continue;
    ++high_points;
    high_explained += is_explained ? 1 : 0;
    high_beside += is_explained || is_beside(p) ? 1 : 0;
  }
  evidence.explained = share(explained, evidence.scan_points);
  evidence.close = share(close, evidence.scan_points);
  if (high_points >= min_high_points)
    evidence.explained = std::max(evidence.explained, share(high_explained, high_points));
  if (high_beside >= min_telling_scan_points)
    evidence.high_agreed *= share(high_explained, high_beside);
}

bool MapSurroundings::is_beside(const Eigen::Vector3f& point_map) const {
  const Neighbours near = map_.planes.nearest(point_map, 1, beside_m);
  return near.count > 0 &&
         (near.points[0].position_map - point_map).head<2>().norm() > max_distance_m;
}

std::pair<int, int> MapSurroundings::explained_by_one(
    const LocalizationQuery& query, const Eigen::Isometry3d& T_map_upright_a,
    const Eigen::Isometry3d& T_map_upright_b) const {
  const Eigen::Isometry3f T_a = T_map_upright_a.cast<float>();
  const Eigen::Isometry3f T_b = T_map_upright_b.cast<float>();
  std::pair<int, int> only(0, 0);
  for (const FeaturePoint& point : query.features_upright.points) {
    if (point.position_lidar.norm() > explained_range_m) continue;
    const bool by_a = map_.planes.nearest(T_a * point.position_lidar, 1, max_distance_m).count > 0;
    const bool by_b = map_.planes.nearest(T_b * point.position_lidar, 1, max_distance_m).count > 0;
    only.first += by_a && !by_b ? 1 : 0;
    only.second += by_b && !by_a ? 1 : 0;
  }
  return only;
}

void MapSurroundings::ask_ground(const LocalizationQuery& query, const Eigen::Isometry3f& T,
                                 PoseEvidence& evidence) const {
  int level = 0;
  for (const FeaturePoint& point : query.features_upright.level_points) {
    const Eigen::Vector3f p = T * point.position_lidar;
    const Neighbours near = map_.planes.nearest(p, 1, ground_search_m);
    if (near.count == 0) continue;
    ++evidence.level_points;
    const float off_m = near.points[0].position_map.z() - p.z();
    if (std::abs(off_m) < max_level_distance_m) ++level;
  }
  evidence.level = share(level, evidence.level_points);
}

void MapSurroundings::ask_scan(const LocalizationQuery& query, const Eigen::Isometry3f& T,
                               PoseEvidence& evidence) const {
  const Eigen::Isometry3f T_upright_map = T.inverse();
  const Eigen::Isometry3f T_foot_map = query.T_foot_upright.cast<float>() * T_upright_map;
  int confirmed = 0;
  int high_points = 0;
  int high_confirmed = 0;
  for (const LabelledPoint& point : points_map_) {
    const Eigen::Vector3f p = T_upright_map * point.position_map;
    if (p.squaredNorm() > visible_range_m * visible_range_m) continue;
    const float height_m = (T_foot_map * point.position_map).z();
    if (!is_expected(point, query.has_ground ? height_m : any_height_m)) continue;
    const DirectionRanges::Sight sight = query.ranges_upright.look_at(p);
    if (sight == DirectionRanges::Sight::unknown) continue;
    const int is_hit = sight == DirectionRanges::Sight::hit ? 1 : 0;
    ++evidence.map_points;
    confirmed += is_hit;
    if (!query.has_ground || height_m <= max_traffic_height_m) continue;
    ++high_points;
    high_confirmed += is_hit;
  }
  evidence.confirmed = share(confirmed, evidence.map_points);
  if (high_points >= min_telling_map_points)
    evidence.high_agreed *= share(high_confirmed, high_points);
}

}  // namespace stillmap
