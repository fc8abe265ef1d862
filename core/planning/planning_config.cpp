#include "core/planning/planning_config.hpp"

#include <sstream>

namespace stillmap {

std::string PlanningConfig::faults() const {
  std::ostringstream faults;
  if (!(cost_weight >= 0.0 && cost_weight <= 1e3)) {
    faults << "cost_weight = " << cost_weight << "; must be 0 to 1000\n";
  }
  if (!(reverse_factor >= 1.0 && reverse_factor <= 1e3)) {
    faults << "reverse_factor = " << reverse_factor << "; must be 1 to 1000\n";
  }
  if (seed == 0) faults << "seed = 0; must be 1 or more\n";
  return faults.str();
}

}  // namespace stillmap
