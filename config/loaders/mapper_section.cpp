#include "config/loaders/mapper_section.hpp"

#include <array>
#include <vector>

namespace stillmap {
namespace {

constexpr Range lengths_m{0.001, 10000};
constexpr Range shares{0, 1};

/// Written as [x_min, y_min, z_min, x_max, y_max, z_max]; an empty list is an empty box.
void read_box(YamlSection& section, const std::string& name, Eigen::AlignedBox3d& box) {
  std::vector<double> faces;
  if (!box.isEmpty()) {
    faces.insert(faces.end(), box.min().begin(), box.min().end());
    faces.insert(faces.end(), box.max().begin(), box.max().end());
  }
  section.number_list(name, faces, {-1000, 1000});
  box.setEmpty();
  if (faces.empty()) return;
  if (faces.size() != 6) {
    section.fault(name, "has " + std::to_string(faces.size()) +
                            " numbers; wanted are none, or x_min, y_min, z_min, x_max, y_max, "
                            "z_max");
    return;
  }
  box.min() = Eigen::Map<const Eigen::Vector3d>(faces.data());
  box.max() = Eigen::Map<const Eigen::Vector3d>(faces.data() + 3);
  if (box.isEmpty()) section.fault(name, "has a minimum above its maximum");
}

void read_prepare(YamlSection section, PrepareConfig& prepare) {
  section.number_or("sensor", "min_range_m", prepare.min_range_m, {0, 1000});
  section.number_or("sensor", "max_range_m", prepare.max_range_m, {0.1, 10000});
  read_box(section, "ego_hull_lidar_m", prepare.ego_hull_lidar);
  section.boolean("compensate_motion", prepare.deskew);
}

void read_features(YamlSection section, FeatureConfig& features) {
  section.number("edge_curvature_m2", features.edge_curvature_m2, {0, 1000});
  section.number("plane_curvature_m2", features.plane_curvature_m2, {0, 1000});
  section.integer("edges_per_sector", features.edges_per_sector, {1, 1000});
  section.number("edge_spacing_m", features.edge_spacing_m, lengths_m);
  section.number("map_plane_spacing_m", features.map_plane_spacing_m, lengths_m);
  section.number("plane_spacing_m", features.plane_spacing_m, lengths_m);
  section.integer("min_surface_rings", features.min_surface_rings, {1, 100000});
  section.number("map_surface_spacing_m", features.map_surface_spacing_m, lengths_m);
  section.number("surface_spacing_m", features.surface_spacing_m, lengths_m);
  section.integer("max_surfaces", features.max_surfaces, {500, 1000000});
}

void read_local_map(YamlSection section, LocalMapConfig& local_map) {
  section.number("voxel_size_m", local_map.voxel_size_m, lengths_m);
  section.integer("max_points_per_voxel", local_map.max_points_per_voxel, {1, 10000});
  section.number("min_spacing_m", local_map.min_spacing_m, {0, 100});
  section.number("radius_m", local_map.radius_m, {1, 10000});
}

void read_registration(YamlSection section, RegistrationConfig& registration) {
  section.integer("neighbours", registration.neighbours, {3, 100});
  section.number("max_neighbour_distance_m", registration.max_neighbour_distance_m, lengths_m);
  section.number("max_residual_m", registration.max_residual_m, lengths_m);
  section.integer("max_iterations", registration.max_iterations, {1, 1000});
  section.number("step_translation_m", registration.step_translation_m, {1e-9, 1});
  section.number("step_rotation_rad", registration.step_rotation_rad, {1e-9, 1});
  section.number("robust_scale_m", registration.robust_scale_m, {0, 100});
  section.number("sweep_translation_m", registration.sweep_translation_m, {0, 10});
  section.number("sweep_rotation_rad", registration.sweep_rotation_rad, {1e-6, 10});
  section.number("sweep_tilt_rad", registration.sweep_tilt_rad, {1e-6, 10});
  section.number("sweep_bend_rad", registration.sweep_bend_rad, {0, 10});
  section.number("across_rings_weight", registration.across_rings_weight, shares);
  section.number("min_plane_width", registration.min_plane_width, shares);
  section.integer("sparse_ring_neighbours", registration.sparse_ring_neighbours, {5, 16});
  section.number("sparse_ring_plane_width", registration.sparse_ring_plane_width, shares);
  section.number("plane_deviation_m", registration.plane_deviation_m, {0, 10});
  section.number("sparse_ring_plane_deviation_m", registration.sparse_ring_plane_deviation_m,
                 {0, 10});
  section.number("max_extrapolation", registration.max_extrapolation, {0, 100});
  section.integer("min_correspondences", registration.min_correspondences, {6, 100000});
  section.number("min_observability", registration.min_observability, shares);
}

void read_motion(YamlSection section, MotionConfig& motion) {
  section.number("inconsistency_threshold", motion.inconsistency_threshold, shares);
  section.boolean("use_range_image_history", motion.use_range_image_history);
  section.integer("range_image_history_size", motion.range_image_history_size, {1, 100});
  section.integer("range_image_history_interval", motion.range_image_history_interval, {1, 1000});
  section.number("free_margin_m", motion.free_margin_m, {0, 100});
  section.number("free_margin_share", motion.free_margin_share, shares);
  section.number("moving_share", motion.moving_share, shares);
  section.number("object_gap_m", motion.object_gap_m, lengths_m);
}

void read_odometry(YamlSection section, OdometryConfig& odometry) {
  std::vector<YamlSection::Choice<Weighting>> weightings;
  weightings.reserve(named_weightings.size());
  for (const auto& [name, weighting] : named_weightings) weightings.push_back({name, weighting});
  section.choice("weighting", odometry.weighting, weightings);
  section.number("alpha", odometry.alpha, shares);
  section.boolean("paper_exact", odometry.paper_exact);
  read_features(section.section("features"), odometry.features);
  read_local_map(section.section("local_map"), odometry.local_map);
  read_registration(section.section("registration"), odometry.registration);
  read_motion(section.section("motion"), odometry.motion);
  section.faults(odometry.faults());
}

void read_static_map(YamlSection section, StaticMapConfig& static_map) {
  section.number("voxel_size_m", static_map.voxel_size_m, {0.01, 10});
  section.number("tile_size_m", static_map.tile_size_m, {0.1, 1000});
  section.number("max_range_m", static_map.max_range_m, {1, 10000});
  section.integer("min_points", static_map.min_points, {1, 1000000});
  section.integer("clearing_interval", static_map.clearing_interval, {1, 1000});
  section.integer("misses_to_clear", static_map.misses_to_clear, {1, 1000});
  section.number("misses_per_hit", static_map.misses_per_hit, {0, 1000});
  section.integer("label_trust", static_map.label_trust, {1, 1000});
  section.integer("free_space_history", static_map.free_space_history, {0, 1000});
  section.number("clearing_range_m", static_map.clearing_range_m, {0, 1000});
  section.number("clearing_margin_m", static_map.clearing_margin_m, {0.01, 100});
  section.number("clearing_margin_share", static_map.clearing_margin_share, {0, 1});
  section.faults(static_map.faults());
}

}  // namespace

void read_mapper(YamlSection& file, MapperConfig& mapper) {
  read_prepare(file.section("prepare"), mapper.prepare);
  read_odometry(file.section("odometry"), mapper.odometry);
  read_static_map(file.section("static_map"), mapper.static_map);
}

}  // namespace stillmap
