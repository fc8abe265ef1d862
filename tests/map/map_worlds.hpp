#pragma once

#include <cstdint>

#include "core/lidar/labelled_scan.hpp"
#include "core/map/static_map.hpp"

namespace stillmap::test {

/// Adds a point that did not move.
inline void add_point(LabelledScan& scan, const Eigen::Vector3f& p_lidar, SemanticClass label,
                      Motion motion = Motion::stationary, float confidence = 1.0F) {
  scan.scan.points_lidar.push_back(p_lidar);
  scan.labels.classes.push_back(label);
  scan.labels.confidence.push_back(confidence);
  scan.motion.push_back(motion);
}

/// A box without faces.
[[nodiscard]] inline Eigen::AlignedBox3d everywhere() {
  constexpr double far_m = 1e9;
  return {Eigen::Vector3d::Constant(-far_m), Eigen::Vector3d::Constant(far_m)};
}

/// A scan of an HDL-64E's shape in a street: ground, two house fronts with depth, poles and trees.
/// `columns` times 64 points.
[[nodiscard]] LabelledScan street_scan(std::uint32_t seed, int columns = 1875);

/// A drive of `scans` scans along x through such a street, one metre a scan.
[[nodiscard]] StaticMap street_map(int scans, int columns = 400);

}  // namespace stillmap::test
