#include "core/simulation/street_side.hpp"

namespace stillmap::simulation {
namespace {

using Eigen::Vector2d;

void add_sides(std::vector<StreetSide>& sides, const std::vector<StreetPlan>& streets,
               const std::vector<StreetPlan>& across, double margin, bool along_u) {
  const double low = across.front().position_m - margin;
  const double high = across.back().position_m + margin;
  const Vector2d way = along_u ? Vector2d(1, 0) : Vector2d(0, 1);
  for (const StreetPlan& street : streets) {
    const auto point = [&](double along) {
      return along_u ? Vector2d(along, street.position_m) : Vector2d(street.position_m, along);
    };
    sides.push_back({street.profile, point(low), way, high - low});
    sides.push_back({street.profile, point(high), -way, high - low});
  }
}

}  // namespace

std::vector<StreetSide> street_sides(const CityPlan& plan) {
  std::vector<StreetSide> sides;
  add_sides(sides, plan.streets_along_u, plan.streets_along_v, plan.margin_m, true);
  add_sides(sides, plan.streets_along_v, plan.streets_along_u, plan.margin_m, false);
  return sides;
}

}  // namespace stillmap::simulation
