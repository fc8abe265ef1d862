#include "core/graph/submap.hpp"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace stillmap {
namespace {

/// Sorts by x, then y, then z.
std::uint64_t place_of(const Eigen::Vector3f& point, float voxel_size_m) {
  constexpr int bits = 21;
  constexpr std::int64_t offset = 1 << (bits - 1);
  const auto part = [&](float value) {
    return static_cast<std::uint64_t>(static_cast<std::int64_t>(std::floor(value / voxel_size_m)) +
                                      offset);
  };
  return part(point.x()) << (2 * bits) | part(point.y()) << bits | part(point.z());
}

/// Another number for every place, with its parts mixed: the table takes the lowest bits alone.
std::uint64_t mixed(std::uint64_t place) {
  const std::uint64_t spread = place * 0x9E3779B97F4A7C15ULL;
  return spread ^ (spread >> 32U);
}

}  // namespace

Eigen::Isometry3d upright_from_key(const Eigen::Isometry3d& T_odom_key) {
  const Eigen::Vector3d ahead_odom = T_odom_key.linear().col(0);
  const double yaw = std::atan2(ahead_odom.y(), ahead_odom.x());
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  T.linear() = Eigen::AngleAxisd(-yaw, Eigen::Vector3d::UnitZ()) * T_odom_key.linear();
  return T;
}

void SubmapBuilder::add(const LabelledScan& scan, const Eigen::Isometry3d& T_odom_lidar) {
  const Eigen::Vector3d at_odom = T_odom_lidar.translation();
  if (scans_ == 0) origin_odom_ = at_odom;
  if (scans_ > 0 && (at_odom - last_odom_).norm() < config_.scan_spacing_m) return;
  last_odom_ = at_odom;
  ++scans_;
  Eigen::Isometry3d T_origin_lidar = T_odom_lidar;
  T_origin_lidar.translation() -= origin_odom_;
  const Eigen::Isometry3f T = T_origin_lidar.cast<float>();
  const auto max_squared = static_cast<float>(config_.max_range_m * config_.max_range_m);
  for (std::size_t i = 0; i < scan.scan.size(); ++i) {
    const Eigen::Vector3f& p = scan.scan.points_lidar[i];
    if (scan.motion[i] != Motion::stationary || !(p.squaredNorm() < max_squared)) continue;
    if (!is_movable(scan.label(i))) add(T * p, scan.label(i));
  }
}

void SubmapBuilder::add(const Eigen::Vector3f& point_origin, SemanticClass label) {
  Voxel& voxel = voxels_[mixed(place_of(point_origin, static_cast<float>(config_.voxel_size_m)))];
  if (voxel.scans == 0) voxel.label = label;
  if (voxel.last_scan != scans_) ++voxel.scans;
  voxel.last_scan = scans_;
  voxel.sum += point_origin;
  voxel.points += 1.0F;
}

Submap SubmapBuilder::take(const Eigen::Isometry3d& T_odom_key) {
  Submap submap;
  submap.T_submap_key = upright_from_key(T_odom_key);
  Eigen::Isometry3d T_origin_key = T_odom_key;
  T_origin_key.translation() -= origin_odom_;
  const Eigen::Isometry3f T = (submap.T_submap_key * T_origin_key.inverse()).cast<float>();
  // In the order of their places: what the table's order depends on must not change results.
  std::vector<std::pair<std::uint64_t, std::pair<Eigen::Vector3f, SemanticClass>>> kept;
  for (const auto& [key, voxel] : voxels_) {
    if (voxel.scans < config_.min_scans) continue;
    const Eigen::Vector3f mean = voxel.sum / voxel.points;
    kept.push_back({place_of(mean, static_cast<float>(config_.voxel_size_m)), {mean, voxel.label}});
  }
  const auto by_place = [](const auto& a, const auto& b) {
    return std::tuple(a.first, a.second.first.x(), a.second.first.y(), a.second.first.z()) <
           std::tuple(b.first, b.second.first.x(), b.second.first.y(), b.second.first.z());
  };
  std::ranges::sort(kept, by_place);
  submap.points_submap.reserve(kept.size());
  submap.classes.reserve(kept.size());
  for (const auto& [place, voxel] : kept) {
    submap.points_submap.push_back(T * voxel.first);
    submap.classes.push_back(voxel.second);
  }
  *this = SubmapBuilder(config_);
  return submap;
}

}  // namespace stillmap
