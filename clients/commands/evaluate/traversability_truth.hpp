#pragma once

#include "core/simulation/city_truth.hpp"
#include "core/traversability/traversability_score.hpp"

namespace stillmap::cli {

/// What a cell of a simulated city truly is for a robot. `truth` must outlive the answer.
[[nodiscard]] TraversabilityTruth simulated_traversability(const simulation::CityTruth& truth,
                                                           const RobotProfile& profile,
                                                           double cell_m,
                                                           const Eigen::Isometry3d& T_city_map);

}  // namespace stillmap::cli
