#pragma once

#include <Eigen/Core>
#include <cmath>
#include <vector>

#include "core/simulation/city_plan.hpp"

namespace stillmap::simulation {

/// One side of a street, seen in the direction in which its traffic goes; plan coordinates [m].
struct StreetSide {
  StreetProfile profile;
  Eigen::Vector2d start, along;
  double length_m;

  [[nodiscard]] Eigen::Vector2d at(double along_m, double right_m) const {
    return start + along_m * along + right_m * Eigen::Vector2d(along.y(), -along.x());
  }
  [[nodiscard]] double heading() const { return std::atan2(along.y(), along.x()); }
};

/// Both sides of every street, from margin to margin.
[[nodiscard]] std::vector<StreetSide> street_sides(const CityPlan& plan);

}  // namespace stillmap::simulation
