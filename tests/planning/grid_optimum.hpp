#pragma once

#include <Eigen/Core>
#include <optional>

#include "core/traversability/traversability_view.hpp"

namespace stillmap::test {

/// Length of the shortest path for a robot that keeps its circumscribed circle on free ground, over
/// the 16 steps to a cell's near neighbours; nothing if there is none [m]. Brute-force Dijkstra.
[[nodiscard]] std::optional<double> shortest_path_m(const TraversabilityView& view,
                                                    const Eigen::Vector2d& from_map,
                                                    const Eigen::Vector2d& to_map);

}  // namespace stillmap::test
