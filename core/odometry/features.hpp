#pragma once

#include <cstdint>
#include <vector>

#include "core/lidar/scan.hpp"
#include "core/odometry/odometry_config.hpp"

namespace stillmap {

/// The paper's F_e and F_p as indices into the scan.
struct Features {
  /// Edge points, thinned to `edge_spacing_m`.
  std::vector<std::uint32_t> edges;
  /// Plane points, thinned to `map_plane_spacing_m`: what the local map takes in.
  std::vector<std::uint32_t> planes;
  /// Those of `planes` that are registered, thinned to `plane_spacing_m`.
  std::vector<std::uint32_t> registered_planes;
};

/// Edge and plane points of every ring by their curvature (LOAM V-A, with
/// the rejection of occluded and grazing points that A-LOAM dropped). `scan.ring` must be known.
[[nodiscard]] Features extract_features(const Scan& scan, const FeatureConfig& config);

/// What `extract_features` sees of one ring, for its tests: curvature of each point of the ring,
/// NaN where the ring has too few neighbours or jumps in depth.
[[nodiscard]] std::vector<float> ring_curvature(const std::vector<Eigen::Vector3f>& ring_lidar);

}  // namespace stillmap
