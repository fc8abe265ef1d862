#pragma once

#include <cstdint>
#include <memory>

#include "core/lidar/labelled_scan.hpp"
#include "core/lidar/trajectory.hpp"
#include "core/localization/place_index.hpp"
#include "core/map/tile.hpp"
#include "core/simulation/simulation.hpp"

namespace stillmap::test {

/// A drive of 24 s round a block of 60 m, by a lidar of 16 rings.
[[nodiscard]] simulation::SimulationConfig yard(std::uint64_t seed, std::uint64_t day);

/// The labels that a simulated scan brings.
[[nodiscard]] PointLabels labels_of(const Scan& scan);

struct MappedYard {
  std::shared_ptr<const MapSnapshot> view;
  Trajectory trajectory;
};

/// The yard of seed 1, mapped on day 0 with true poses.
[[nodiscard]] const MappedYard& first_yard();
/// The same, and a copy of it farther on: each place is there twice.
[[nodiscard]] MappedYard yard_twice();
/// How far on along x the copy is [m].
[[nodiscard]] double second_yard_m();

[[nodiscard]] std::shared_ptr<const PlaceIndex> index_of(const MappedYard& stored);

}  // namespace stillmap::test
