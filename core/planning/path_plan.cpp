#include "core/planning/path_plan.hpp"

#include <array>

namespace stillmap {

std::string_view name(PlanStatus status) {
  constexpr std::array<std::string_view, 6> names{
      "found", "invalid request", "start blocked", "goal blocked", "no way", "out of time"};
  return names.at(static_cast<std::size_t>(status));
}

std::vector<PlanarPose> PathPlan::path_map() const {
  std::vector<PlanarPose> path;
  path.reserve(poses.size());
  for (const PlannedPose& planned : poses) path.push_back(planned.pose);
  return path;
}

}  // namespace stillmap
