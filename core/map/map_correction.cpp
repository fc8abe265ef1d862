#include "core/map/map_correction.hpp"

#include <algorithm>
#include <cassert>
#include <iterator>
#include <utility>

namespace stillmap {

MapCorrection::MapCorrection(std::vector<Pose> poses) : poses_(std::move(poses)) {
  assert(!poses_.empty());
}

const Eigen::Isometry3d* MapCorrection::at(std::int64_t stamp_ns) const {
  const auto after = std::ranges::upper_bound(poses_, stamp_ns, {}, &Pose::stamp_ns);
  return after == poses_.begin() ? nullptr : &std::prev(after)->T_new_old;
}

double MapCorrection::max_shift_m(const Pose& pose, double range_m) {
  const Eigen::Isometry3d& T = pose.T_new_old;
  const double turn_rad = Eigen::AngleAxisd(T.linear()).angle();
  return (T * pose.position_map - pose.position_map).norm() + turn_rad * range_m;
}

MapCorrection combined(const MapCorrection& first, const MapCorrection& second) {
  std::vector<MapCorrection::Pose> poses = second.poses();
  for (MapCorrection::Pose& pose : poses) {
    const Eigen::Isometry3d* const T_new_old = first.at(pose.stamp_ns);
    if (T_new_old == nullptr) continue;
    pose.position_map = T_new_old->inverse() * pose.position_map;
    pose.T_new_old = pose.T_new_old * *T_new_old;
  }
  return MapCorrection(std::move(poses));
}

}  // namespace stillmap
