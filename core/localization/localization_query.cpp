#include "core/localization/localization_query.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <span>
#include <utility>

#include "core/frames/rigid_motion.hpp"
#include "core/lidar/direction_cells.hpp"
#include "core/lidar/level_plane.hpp"
#include "core/odometry/features.hpp"

namespace stillmap {
namespace {

/// Ground that a lidar stands on is no steeper than this to it, and so far below [m].
constexpr double max_slope = 0.4;
constexpr double min_ground_share = 0.25;
constexpr double min_lidar_height_m = 0.1;
constexpr double max_lidar_height_m = 6.0;
/// Level points that are fitted are as near as this [m].
constexpr float max_ground_range_m = 25.0F;
/// What stands up is taken as near as this [m].
constexpr float max_landmark_range_m = 45.0F;

Scan turned(const Scan& scan, const Eigen::Matrix3d& R) {
  Scan turned = scan;
  const Eigen::Matrix3f rotation = R.cast<float>();
  for (Eigen::Vector3f& p : turned.points_lidar) p = rotation * p;
  return turned;
}

std::vector<Eigen::Vector3f> near_ground(const FeatureSets& features) {
  std::vector<Eigen::Vector3f> near;
  for (const FeaturePoint& point : features.level_points) {
    if (point.position_lidar.norm() < max_ground_range_m) near.push_back(point.position_lidar);
  }
  return near;
}

std::optional<LevelPlane> ground_among(std::span<const Eigen::Vector3f> points) {
  const auto plane = fit_level_plane(points, max_slope, min_ground_share);
  const bool can_stand_on =
      plane && -plane->height_m > min_lidar_height_m && -plane->height_m < max_lidar_height_m;
  return can_stand_on ? plane : std::nullopt;
}

std::optional<LevelPlane> fit_ground(std::vector<Eigen::Vector3f> points) {
  if (const auto ground = ground_among(points)) return ground;
  // Of a ceiling a low lidar sees more than of the floor.
  std::erase_if(points, [](const Eigen::Vector3f& p) { return p.z() >= 0.0F; });
  return ground_among(points);
}

Eigen::Isometry3d foot_of(const LevelPlane& ground_upright) {
  const Eigen::Vector3d up =
      Eigen::Vector3d(-ground_upright.slope.x(), -ground_upright.slope.y(), 1.0).normalized();
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = levelling_rotation(up);
  T.translation().z() = -ground_upright.height_m * up.z();
  return T;
}

}  // namespace

DirectionRanges::DirectionRanges(const std::vector<Eigen::Vector3f>& points_lidar)
    : cells_(DirectionCell::count) {
  for (const Eigen::Vector3f& p : points_lidar) {
    Ranges& ranges = cells_[DirectionCell::of(p).index()];
    const float range = p.norm();
    ranges.nearest = ranges.nearest == 0.0F ? range : std::min(ranges.nearest, range);
    ranges.farthest = std::max(ranges.farthest, range);
  }
}

DirectionRanges::Sight DirectionRanges::look_at(const Eigen::Vector3f& p_lidar) const {
  const float range = p_lidar.norm();
  const float margin = 0.5F + 0.02F * range;
  const DirectionCell direction = DirectionCell::of(p_lidar);
  bool is_seen = cells_[direction.index()].farthest > 0.0F;
  bool is_beyond_all = is_seen;
  for (int row = direction.row - 1; row <= direction.row + 1; ++row) {
    for (int column = direction.column - 1; column <= direction.column + 1; ++column) {
      const Ranges& ranges = cells_[DirectionCell{column, row}.index()];
      if (ranges.farthest == 0.0F) continue;
      if (ranges.nearest < range + margin && ranges.farthest > range - margin) return Sight::hit;
      is_beyond_all &= ranges.nearest > range + margin;
    }
  }
  return is_beyond_all ? Sight::seen_through : Sight::unknown;
}

LocalizationQuery::LocalizationQuery(const Scan& scan, const PointLabels& labels,
                                     const Eigen::Matrix3d& R_body_lidar)
    : ranges_upright({}) {
  T_upright_lidar.linear() = R_body_lidar;
  const Scan upright = turned(scan, R_body_lidar);
  ranges_upright = DirectionRanges(upright.points_lidar);
  const Features features = extract_surfaces(upright, FeatureConfig{});
  const auto collect = [&](const std::vector<std::uint32_t>& from, std::vector<FeaturePoint>& to) {
    for (const std::uint32_t i : from) {
      const SemanticClass label = labels.empty() ? SemanticClass::unlabeled : labels.classes[i];
      if (is_movable(label)) continue;
      to.push_back({.position_lidar = upright.points_lidar[i],
                    .label = label,
                    .is_level = features.is_level[i]});
    }
  };
  collect(features.upright_points, features_upright.points);
  collect(features.level_points, features_upright.level_points);
  collect(few_surfaces(upright, FeatureConfig{}, features), features_upright.surfaces);
  const auto ground = fit_ground(near_ground(features_upright));
  has_ground = ground.has_value();
  if (ground) T_foot_upright = foot_of(*ground);
  const Eigen::Isometry3f T = T_foot_upright.cast<float>();
  for (const FeaturePoint& point : features_upright.points) {
    if (point.position_lidar.norm() < max_landmark_range_m)
      landmarks_foot.push_back(T * point.position_lidar);
  }
}

}  // namespace stillmap
