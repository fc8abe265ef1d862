#pragma once

#include "core/simulation/city_truth.hpp"
#include "core/traversability/traversability_score.hpp"

namespace stillmap {

/// What a cell of a simulated city truly is for a robot. `truth` must outlive the answer.
[[nodiscard]] AreaTruth simulated_truth(const CityTruth& truth, const RobotProfile& profile,
                                        double cell_m, const Eigen::Isometry3d& T_city_map);

}  // namespace stillmap
