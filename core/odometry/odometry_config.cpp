#include "core/odometry/odometry_config.hpp"

#include <sstream>

#include "core/odometry/feature_map.hpp"

namespace stillmap {
namespace {

/// Collects faults as "field = value: must be ..." lines.
class FaultList {
 public:
  void require(bool holds, const char* field, double value, const char* must) {
    if (!holds) text_ << field << " = " << value << ": must be " << must << '\n';
  }
  [[nodiscard]] std::string text() const { return text_.str(); }

 private:
  std::ostringstream text_;
};

void check(const FeatureConfig& c, FaultList& faults) {
  faults.require(c.edge_curvature_m2 > 0.0, "features.edge_curvature_m2", c.edge_curvature_m2,
                 "above 0");
  faults.require(c.plane_curvature_m2 > 0.0, "features.plane_curvature_m2", c.plane_curvature_m2,
                 "above 0");
  faults.require(c.edges_per_sector >= 0, "features.edges_per_sector", c.edges_per_sector,
                 "0 or more");
  faults.require(c.edge_spacing_m > 0.0, "features.edge_spacing_m", c.edge_spacing_m, "above 0");
  faults.require(c.map_plane_spacing_m > 0.0, "features.map_plane_spacing_m", c.map_plane_spacing_m,
                 "above 0");
  faults.require(c.plane_spacing_m > 0.0, "features.plane_spacing_m", c.plane_spacing_m, "above 0");
  faults.require(c.min_surface_rings >= 1, "features.min_surface_rings", c.min_surface_rings,
                 "1 or more");
  faults.require(c.map_surface_spacing_m > 0.0, "features.map_surface_spacing_m",
                 c.map_surface_spacing_m, "above 0");
  faults.require(c.max_surfaces >= 500, "features.max_surfaces", c.max_surfaces, "500 or more");
  faults.require(c.surface_spacing_m > 0.0, "features.surface_spacing_m", c.surface_spacing_m,
                 "above 0");
}

void check(const LocalMapConfig& c, FaultList& faults) {
  faults.require(c.voxel_size_m > 0.0, "local_map.voxel_size_m", c.voxel_size_m, "above 0");
  faults.require(c.max_points_per_voxel >= 1 && c.max_points_per_voxel <= 32,
                 "local_map.max_points_per_voxel", c.max_points_per_voxel, "within 1..32");
  faults.require(c.min_spacing_m >= 0.0, "local_map.min_spacing_m", c.min_spacing_m, "0 or more");
  faults.require(c.radius_m > 0.0, "local_map.radius_m", c.radius_m, "above 0");
}

void check(const RegistrationConfig& c, const LocalMapConfig& map, FaultList& faults) {
  faults.require(c.neighbours >= 5 && c.neighbours <= Neighbours::capacity,
                 "registration.neighbours", c.neighbours, "within 5..16");
  faults.require(c.sparse_ring_neighbours >= 5 && c.sparse_ring_neighbours <= Neighbours::capacity,
                 "registration.sparse_ring_neighbours", c.sparse_ring_neighbours, "within 5..16");
  faults.require(c.max_neighbour_distance_m > 0.0 && c.max_neighbour_distance_m <= map.voxel_size_m,
                 "registration.max_neighbour_distance_m", c.max_neighbour_distance_m,
                 "above 0 and at most local_map.voxel_size_m");
  faults.require(c.max_residual_m > 0.0 && c.max_residual_m <= 1.0, "registration.max_residual_m",
                 c.max_residual_m, "above 0 and at most 1");
  faults.require(c.max_iterations >= 1, "registration.max_iterations", c.max_iterations,
                 "1 or more");
  faults.require(c.step_translation_m > 0.0, "registration.step_translation_m",
                 c.step_translation_m, "above 0");
  faults.require(c.step_rotation_rad > 0.0, "registration.step_rotation_rad", c.step_rotation_rad,
                 "above 0");
  faults.require(c.robust_scale_m >= 0.0, "registration.robust_scale_m", c.robust_scale_m,
                 "0 or more");
  faults.require(c.sweep_translation_m >= 0.0, "registration.sweep_translation_m",
                 c.sweep_translation_m, "0 or more");
  faults.require(c.sweep_rotation_rad > 0.0, "registration.sweep_rotation_rad",
                 c.sweep_rotation_rad, "above 0");
  faults.require(c.sweep_tilt_rad > 0.0, "registration.sweep_tilt_rad", c.sweep_tilt_rad,
                 "above 0");
  faults.require(c.sweep_bend_rad >= 0.0, "registration.sweep_bend_rad", c.sweep_bend_rad,
                 "0 or more");
  faults.require(c.min_correspondences >= 6, "registration.min_correspondences",
                 c.min_correspondences, "6 or more");
  faults.require(c.min_plane_width >= 0.0 && c.min_plane_width < 1.0,
                 "registration.min_plane_width", c.min_plane_width, "within 0..1");
  faults.require(c.sparse_ring_plane_width >= 0.0 && c.sparse_ring_plane_width < 1.0,
                 "registration.sparse_ring_plane_width", c.sparse_ring_plane_width, "within 0..1");
  faults.require(c.plane_deviation_m >= 0.0, "registration.plane_deviation_m", c.plane_deviation_m,
                 "0 or more");
  faults.require(c.sparse_ring_plane_deviation_m >= 0.0,
                 "registration.sparse_ring_plane_deviation_m", c.sparse_ring_plane_deviation_m,
                 "0 or more");
  faults.require(c.across_rings_weight >= 0.0 && c.across_rings_weight <= 1.0,
                 "registration.across_rings_weight", c.across_rings_weight, "within 0..1");
  faults.require(c.max_extrapolation >= 0.0 && c.max_extrapolation <= 100.0,
                 "registration.max_extrapolation", c.max_extrapolation, "within 0..100");
  faults.require(c.min_observability >= 0.0 && c.min_observability < 1.0,
                 "registration.min_observability", c.min_observability, "within 0..1");
}

void check(const MotionConfig& c, FaultList& faults) {
  faults.require(c.inconsistency_threshold >= 0.0 && c.inconsistency_threshold <= 1.0,
                 "motion.inconsistency_threshold", c.inconsistency_threshold, "within 0..1");
  faults.require(c.range_image_history_size >= 1, "motion.range_image_history_size",
                 c.range_image_history_size, "1 or more");
  faults.require(c.range_image_history_interval >= 1, "motion.range_image_history_interval",
                 c.range_image_history_interval, "1 or more");
  faults.require(c.free_margin_m > 0.0, "motion.free_margin_m", c.free_margin_m, "above 0");
  faults.require(c.free_margin_share >= 0.0, "motion.free_margin_share", c.free_margin_share,
                 "0 or more");
  faults.require(c.moving_share > 0.0 && c.moving_share <= 1.0, "motion.moving_share",
                 c.moving_share, "above 0 and at most 1");
  faults.require(c.object_gap_m > 0.0, "motion.object_gap_m", c.object_gap_m, "above 0");
}

}  // namespace

std::string OdometryConfig::faults() const {
  FaultList faults;
  faults.require(alpha >= 0.0 && alpha <= 1.0, "alpha", alpha, "within 0..1");
  faults.require(first_reach_m >= 0.0, "first_reach_m", first_reach_m, "0 or more");
  faults.require(relocalization_interval >= 2, "relocalization_interval", relocalization_interval,
                 "2 or more");
  check(features, faults);
  check(local_map, faults);
  check(registration, local_map, faults);
  check(motion, faults);
  return faults.text();
}

OdometryConfig OdometryConfig::with_method() const {
  OdometryConfig used = *this;
  if (weighting == Weighting::none || paper_exact) {
    used.registration.robust_scale_m = 0.0;
    used.registration.plane_deviation_m = 0.0;
    used.registration.sparse_ring_plane_deviation_m = 0.0;
  }
  if (paper_exact) {
    used.motion.use_range_image_history = false;
    used.registration.across_rings_weight = 1.0;
    used.registration.max_extrapolation = 0.0;
    used.registration.sweep_bend_rad = 0.0;
  }
  return used;
}

OdometryConfig OdometryConfig::at_start() const {
  OdometryConfig used = with_method();
  if (!paper_exact) used.registration.robust_scale_m = registration.robust_scale_m;
  return used;
}

}  // namespace stillmap
