#pragma once

#include "core/evaluation/traversability_score.hpp"
#include "core/simulation/city_truth.hpp"

namespace stillmap::cli {

/// True traversability of a simulated city for a robot. `truth` must outlive the result.
[[nodiscard]] evaluation::TraversabilityTruth simulated_traversability(
    const simulation::CityTruth& truth, const RobotProfile& profile, double cell_m,
    const Eigen::Isometry3d& T_city_map);

}  // namespace stillmap::cli
