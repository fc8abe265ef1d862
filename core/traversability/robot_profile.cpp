#include "core/traversability/robot_profile.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace stillmap {
namespace {

constexpr double max_radius_m = 10.0;

// Written so that NaN fails.
bool is_between(double value, double low, double high) { return value >= low && value <= high; }

void check(std::ostream& faults, const char* field, double value, double low, double high) {
  if (is_between(value, low, high)) return;
  faults << field << " = " << value << "; must be " << low << " to " << high << '\n';
}

void check_footprint(const RobotProfile& profile, std::ostream& faults) {
  check(faults, "length_m", profile.length_m, 0.05, 2.0 * max_radius_m);
  check(faults, "width_m", profile.width_m, 0.05, 2.0 * max_radius_m);
  if (!(std::abs(profile.centre_ahead_m) < 0.5 * profile.length_m)) {
    faults << "centre_ahead_m = " << profile.centre_ahead_m
           << "; the pose must lie within the footprint: less than half of length_m = "
           << profile.length_m << '\n';
  }
  if (!(profile.circumscribed_radius_m() <= max_radius_m)) {
    faults << "length_m and width_m reach " << profile.circumscribed_radius_m()
           << " m from the pose; at most " << max_radius_m << " m can be used\n";
  }
}

void check_costs(const RobotProfile& profile, std::ostream& faults) {
  bool may_enter_something = false;
  for (std::size_t i = 0; i < semantic_class_count; ++i) {
    const auto label = static_cast<SemanticClass>(i);
    const std::optional<double> cost = profile.class_cost.at(i);
    if (!cost) continue;
    may_enter_something = true;
    if (!is_between(*cost, 0.0, 1.0)) {
      faults << "cost of " << name(label) << " = " << *cost << "; must be 0 to 1, or lethal\n";
    }
    if (!is_ground(label) && label != SemanticClass::unlabeled) {
      faults << "cost of " << name(label) << ": is no ground; only ground has a cost\n";
    }
  }
  if (!may_enter_something) faults << "every class of ground is lethal; one must have a cost\n";
}

}  // namespace

double RobotProfile::inscribed_radius_m() const {
  return std::min(0.5 * width_m, 0.5 * length_m - std::abs(centre_ahead_m));
}

double RobotProfile::circumscribed_radius_m() const {
  return std::hypot(0.5 * length_m + std::abs(centre_ahead_m), 0.5 * width_m);
}

double RobotProfile::obstacle_height_m() const { return std::min(max_step_m, ground_clearance_m); }

std::string RobotProfile::faults() const {
  std::ostringstream faults;
  if (name.empty()) faults << "name is empty; clients ask for the profile by it\n";
  check_footprint(*this, faults);
  check(faults, "min_turning_radius_m", min_turning_radius_m, 0.0, 50.0);
  check(faults, "height_m", height_m, 0.05, 10.0);
  check(faults, "ground_clearance_m", ground_clearance_m, 0.0, 2.0);
  check(faults, "max_step_m", max_step_m, 0.01, 2.0);
  check(faults, "max_slope_deg", max_slope_deg, 1.0, 60.0);
  check(faults, "max_roughness_m", max_roughness_m, 0.001, 1.0);
  check(faults, "inferred_cost", inferred_cost, 0.0, 1.0);
  if (!(height_m > ground_clearance_m)) {
    faults << "height_m = " << height_m
           << "; must be above ground_clearance_m = " << ground_clearance_m << '\n';
  }
  check_costs(*this, faults);
  return faults.str();
}

}  // namespace stillmap
