#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <span>
#include <vector>

#include "core/lidar/scan.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/odometry/odometry_config.hpp"

namespace stillmap {

/// The paper's F_e and F_p as indices into the scan.
struct Features {
  /// Edge points, downsampled to `edge_spacing_m`.
  std::vector<std::uint32_t> edges;
  /// Plane points, downsampled to `map_plane_spacing_m`: inserted into the local map.
  std::vector<std::uint32_t> planes;
  /// Those of `planes` that are registered, downsampled to `plane_spacing_m`.
  std::vector<std::uint32_t> registered_planes;
  /// Points of a scan without rings that are registered: the local map says what they lie on.
  std::vector<std::uint32_t> surfaces;
  /// Of every point of the scan, where it has surfaces: it is one, and on level ground.
  std::vector<bool> is_level;
  /// ring_tangents() of the scan for its surfaces; empty where they are not looked at.
  std::vector<Eigen::Vector3f> tangents;
  /// Points of any kind, spread evenly: inserted into the local map for the alignment of points.
  std::vector<std::uint32_t> points;
  /// Those of `points` that are aligned: on something that stands up, and on level ground.
  std::vector<std::uint32_t> upright_points;
  std::vector<std::uint32_t> level_points;
  /// ring_tangents() of the scan for its `upright_points`; empty where they are not looked at.
  std::vector<Eigen::Vector3f> point_tangents;
  /// balance_of() the scan's `points`.
  double balance = 1.0;
};

/// Which share of the directions round the lidar's z where points lie has points opposite, too,
/// 0..1; 1 of no points.
[[nodiscard]] double balance_of(std::span<const Eigen::Vector3f> points_lidar,
                                std::span<const std::uint32_t> chosen);

/// Whether a lidar's scans are registered by surfaces, as those without rings are, or by the edges
/// and planes of its rings.
[[nodiscard]] bool is_registered_by_surfaces(const SensorModel& sensor,
                                             const OdometryConfig& config);

/// Whether a lidar's rings are so far apart that the nearest points of one mostly are its own.
[[nodiscard]] bool has_sparse_rings(const SensorModel& sensor);

/// All points of a scan without rings, thinned: `planes` and `surfaces`. What stands up and what is
/// level ground is told along `up_lidar`, a unit vector: a lidar may hang on its side.
[[nodiscard]] Features extract_surfaces(const Scan& scan, const FeatureConfig& config,
                                        const Eigen::Vector3f& up_lidar = Eigen::Vector3f::UnitZ());

/// About `config.max_surfaces` of the `surfaces`, spread evenly.
[[nodiscard]] std::vector<std::uint32_t> few_surfaces(const Scan& scan, const FeatureConfig& config,
                                                      const Features& features);

/// Edge and plane points of every ring by their curvature (LOAM V-A, with the rejection of occluded
/// and grazing points that A-LOAM dropped). `scan.ring` must be known. `up_lidar` as for
/// extract_surfaces().
[[nodiscard]] Features extract_features(const Scan& scan, const FeatureConfig& config,
                                        const Eigen::Vector3f& up_lidar = Eigen::Vector3f::UnitZ());

/// Curvature of each point of the ring,
/// NaN where the ring has too few neighbours or jumps in depth.
[[nodiscard]] std::vector<float> ring_curvature(const std::vector<Eigen::Vector3f>& ring_lidar);

}  // namespace stillmap
