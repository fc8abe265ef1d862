#include "core/odometry/correspondence_search.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>

namespace stillmap {
namespace {

/// Neighbours are looked up again once the point has moved this far since [m]; nearer than that
/// they are nearly always the same ones: the local map's points are 0.2 m apart.
constexpr float same_neighbours_m = 0.04F;
/// What a plane counts for a point beyond its neighbours: far walls may be all that shows a motion.
constexpr double extrapolated_weight = 0.05;

/// Neighbours that make a plane, where they do, of a lidar that looks one way.
constexpr int wide_neighbours = 10;

enum class FeatureKind { edge, plane, surface };

std::optional<FittedSurface> fit(FeatureKind kind, const Neighbours& neighbours,
                                 double min_plane_width) {
  if (kind == FeatureKind::edge) return fit_line(neighbours);
  return kind == FeatureKind::plane ? fit_plane(neighbours, min_plane_width)
                                    : fit_surface(neighbours, min_plane_width);
}

/// Takes a feature to where the pose puts it. Returns whether its neighbours are to be looked up.
bool move_to(const OdometryResult& pose, const FeaturePoint& feature, Correspondence& found) {
  found.sweep_part = feature.sweep_part;
  found.point_lidar =
      compensated(feature.position_lidar.cast<double>(), found.sweep_part, pose.sweep_correction);
  const Eigen::Vector3f point_map = (pose.T_map_lidar * found.point_lidar).cast<float>();
  if ((point_map - found.searched_map).norm() < same_neighbours_m) return false;
  found.searched_map = point_map;
  return true;
}

/// On level ground a ring lies where the lidar stands, wherever that is: along the ray it says that
/// the lidar did not move.
RingLineWeights ring_line_weights(const FeaturePoint& feature, const RegistrationConfig& config) {
  const bool counts_nothing = feature.is_level && config.across_rings_weight < 1.0;
  return {counts_nothing ? 0.0 : 1.0, config.across_rings_weight};
}

void look_up(const FeaturePoint& feature, FeatureKind kind, const FeatureMap& map,
             const RegistrationLimits& config, const Eigen::Matrix3d& R_map_lidar,
             Correspondence& found) {
  const bool is_wide = config.has_wide_planes && kind == FeatureKind::surface;
  const int count = is_wide ? std::max(wide_neighbours, config.neighbours) : config.neighbours;
  Neighbours neighbours =
      map.nearest(found.searched_map, count, static_cast<float>(config.max_neighbour_distance_m));
  found.in_known_space = neighbours.count > 0;
  const auto fitted = is_wide
                          ? fit_wide_surface(neighbours, config.neighbours, config.min_plane_width)
                          : fit(kind, neighbours, config.min_plane_width);
  const auto surface =
      fitted ? surface_along(*fitted, R_map_lidar * feature.tangent_lidar.cast<double>())
             : std::nullopt;
  found.found = surface.has_value();
  if (!surface) return;
  const double thin_m2 = config.plane_deviation_m * config.plane_deviation_m;
  found.thinness = thin_m2 > 0.0 ? thin_m2 / (thin_m2 + surface->variance_m2) : 1.0;
  found.surface = weighed_ring_line(*surface, found.point_lidar, R_map_lidar,
                                    ring_line_weights(feature, config));
  if (config.max_extrapolation > 0.0 && fitted->normal_count == 1 &&
      extrapolation(*surface, neighbours, found.searched_map.cast<double>()) >
          config.max_extrapolation) {
    found.surface.weights[0] = extrapolated_weight;
  }
  found.inconsistency = feature.confidence * semantic_inconsistency(neighbours, feature.label);
}

/// One correspondence a feature, in the features' order whatever the number of threads.
void find_correspondences(std::span<const FeaturePoint> features, FeatureKind kind,
                          const FeatureMap& map, const OdometryResult& pose,
                          const RegistrationLimits& config, std::span<Correspondence> found) {
  // The map's memory for so many features is on its way while the first of them are looked up.
  constexpr std::size_t ahead = 16;
  const tbb::blocked_range<std::size_t> all(0, features.size(), 128);
  tbb::parallel_for(all, [&](const auto& range) {
    std::array<std::size_t, ahead> moved;
    for (std::size_t i = range.begin(); i < range.end();) {
      std::size_t count = 0;
      for (; i < range.end() && count < ahead; ++i) {
        if (!move_to(pose, features[i], found[i])) continue;
        map.prefetch_near(found[i].searched_map);
        moved[count++] = i;
      }
      for (std::size_t k = 0; k < count; ++k)
        look_up(features[moved[k]], kind, map, config, pose.T_map_lidar.linear(), found[moved[k]]);
    }
  });
}

}  // namespace

std::size_t count_of(const FeatureSets& features) {
  return features.edges.size() + features.planes.size() + features.surfaces.size();
}

void find_all_correspondences(const FeatureSets& features, const LocalMap& map,
                              const OdometryResult& pose, const RegistrationLimits& config,
                              std::span<Correspondence> found) {
  const std::size_t edges = features.edges.size();
  const std::size_t planes = features.planes.size();
  find_correspondences(features.edges, FeatureKind::edge, map.edges, pose, config,
                       found.first(edges));
  find_correspondences(features.planes, FeatureKind::plane, map.planes, pose, config,
                       found.subspan(edges, planes));
  find_correspondences(features.surfaces, FeatureKind::surface, map.planes, pose, config,
                       found.subspan(edges + planes));
}

}  // namespace stillmap
