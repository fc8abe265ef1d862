#pragma once

#include <span>
#include <vector>

#include "core/odometry/registration.hpp"

namespace stillmap {

/// Adds points of a map made earlier (map frame): poles, trunks and traffic signs to the edges, all
/// others to the planes. Movable objects are left out.
void insert_prior_map(std::span<const LabelledPoint> points_map, LocalMap& map);

/// What of a map made earlier a first scan is relocalized in, and the local map that it begins
/// with. To make one takes time in proportion to the points.
struct PriorMap {
  PriorMap(std::vector<LabelledPoint> prior_points_map, const LocalMapConfig& config);

  std::vector<LabelledPoint> points_map;
  LocalMap local_map;
};

}  // namespace stillmap
