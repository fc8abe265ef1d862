#include "core/odometry/prior_map.hpp"

#include <tbb/parallel_invoke.h>

#include <utility>

namespace stillmap {
namespace {

bool is_pole_like(SemanticClass label) {
  return label == SemanticClass::pole || label == SemanticClass::trunk ||
         label == SemanticClass::traffic_sign;
}

}  // namespace

void insert_prior_map(std::span<const LabelledPoint> points_map, LocalMap& map) {
  const auto insert_features = [&] {
    std::vector<LabelledPoint> edges;
    std::vector<LabelledPoint> planes;
    for (const LabelledPoint& point : points_map) {
      if (is_movable(point.label)) continue;
      (is_pole_like(point.label) ? edges : planes).push_back(point);
    }
    map.edges.insert(edges);
    map.planes.insert(planes);
  };
  tbb::parallel_invoke([&] { map.points.insert(points_map); }, insert_features);
}

PriorMap::PriorMap(std::vector<LabelledPoint> prior_points_map, const LocalMapConfig& config)
    : points_map(std::move(prior_points_map)), local_map(config) {
  insert_prior_map(points_map, local_map);
}

}  // namespace stillmap
