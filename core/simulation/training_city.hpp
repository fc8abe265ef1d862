#pragma once

#include <cstdint>
#include <vector>

#include "core/simulation/simulation.hpp"

namespace stillmap::simulation {

/// A sequence for training: random city, materials, and lidar with random flaws (60 % HDL-64E, 20 %
/// VLP-16, 10 % HDL-32E, 10 % with evenly spaced beams). `share_of_plain` of all sequences are
/// without flaws, in `quiet_city` or `crowded_avenue`. The same seed and share give the same
/// sequence.
[[nodiscard]] SimulationConfig training_sequence(std::uint64_t seed, double share_of_plain = 0.4);

/// The same city, materials and noise as those of a sequence for training that is not plain, seen
/// by that lidar, with its flaws.
[[nodiscard]] SimulationConfig any_sequence(std::uint64_t seed, const SensorModel& sensor);

/// Up to `count` scans of the sequence, spread over the route and at least 8 m apart.
[[nodiscard]] std::vector<int> spread_scans(const Simulation& sequence, int count);

}  // namespace stillmap::simulation
