#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "core/planning/coarse_route.hpp"

namespace stillmap {

/// Draws poses for the search. City streets are a small part of the space of all poses: most are
/// drawn beside a coarse route and along it, some with any heading near its ends (where a car may
/// have to turn round), and some from all places where the robot may stand, so that nothing is
/// out of reach.
class PoseSampler {
 public:
  /// Without `is_guided`, only the last kind. The grid must outlive the sampler.
  PoseSampler(const PlanningGrid& grid, const CoarseRoute& route, bool is_guided,
              std::uint32_t seed);

  [[nodiscard]] PlanarPose draw();

 private:
  [[nodiscard]] PlanarPose draw_beside_route();
  [[nodiscard]] PlanarPose draw_near_an_end();
  [[nodiscard]] PlanarPose draw_anywhere();
  [[nodiscard]] double uniform(double low, double high);
  [[nodiscard]] double normal(double deviation);

  const PlanningGrid& grid_;
  /// Headings along the route.
  std::vector<PlanarPose> route_;
  bool is_guided_;
  // Plain engine, own distributions: those of the standard library differ between its makers.
  std::mt19937_64 random_;
};

}  // namespace stillmap
