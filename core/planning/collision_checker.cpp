#include "core/planning/collision_checker.hpp"

#include <algorithm>
#include <limits>
#include <utility>

namespace stillmap {
namespace {

bool is_same(const PlanarPose& a, const PlanarPose& b) {
  return a.position_map == b.position_map && a.heading_rad == b.heading_rad;
}

}  // namespace

double curve_radius_m(const RobotProfile& profile, double cell_m) {
  return std::max(profile.min_turning_radius_m, 0.5 * cell_m);
}

CollisionChecker::CollisionChecker(const PlanningGrid& grid, double reverse_factor)
    : grid_(grid),
      curves_(curve_radius_m(grid.profile(), grid.cell_m())),
      reverse_factor_(reverse_factor) {}

double CollisionChecker::length_m(const PlanarPose& a, const PlanarPose& b) const {
  return curves_.length_m(a, b);
}

void CollisionChecker::visit(const PlanarPose& a, const PlanarPose& b,
                             const std::function<bool(const CurvePose&)>& visit_pose) const {
  ++checked_curves_;
  curves_.visit_between(a, b, 0.5 * grid_.cell_m(), grid_.profile().circumscribed_radius_m(),
                        visit_pose);
}

double CollisionChecker::step_cost(const CurvePose& pose) const {
  const double direction = pose.is_reverse ? reverse_factor_ : 1.0;
  return direction * pose.step_m * grid_.cost_factor(grid_.cell_of(pose.pose.position_map));
}

double CollisionChecker::cost(const PlanarPose& a, const PlanarPose& b) const {
  if (last_ && is_same(last_->a, a) && is_same(last_->b, b)) return last_->cost;
  double sum = 0.0;
  visit(a, b, [&](const CurvePose& pose) {
    const bool is_free = grid_.is_free(pose.pose);
    sum += is_free ? step_cost(pose) : std::numeric_limits<double>::infinity();
    return is_free;
  });
  last_ = Answer{a, b, sum};
  return sum;
}

std::optional<std::vector<PathPoint>> CollisionChecker::connect(const PlanarPose& a,
                                                                const PlanarPose& b) const {
  std::vector<PathPoint> path;
  double sum = 0.0;
  bool is_free = true;
  visit(a, b, [&](const CurvePose& pose) {
    is_free = grid_.is_free(pose.pose);
    if (is_free) path.push_back({pose, sum += step_cost(pose)});
    return is_free;
  });
  return is_free ? std::optional(std::move(path)) : std::nullopt;
}

}  // namespace stillmap
