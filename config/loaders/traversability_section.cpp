#include "config/loaders/traversability_section.hpp"

#include <algorithm>
#include <utility>

#include "config/loaders/robot_profile.hpp"
#include "core/traversability/traversability_map.hpp"

namespace stillmap {

void read_traversability(YamlSection section, const std::filesystem::path& folder,
                         double tile_size_m, TraversabilityConfig& config) {
  section.text_list("profiles", config.profiles);
  section.number("update_period_s", config.update_period_s, {0.01, 86400});
  section.text("grid_profile", config.grid_profile);
  section.number("grid_window_m", config.grid_window_m, {0, 100'000});
  for (std::string& profile : config.profiles) profile = robot_from(folder, profile);
  try {
    const std::vector<RobotProfile> robots = load_robots(config);
    for (const RobotProfile& robot : robots) {
      const std::string fault = tile_size_fault(robot, tile_size_m);
      if (!fault.empty()) section.fault("profiles", fault);
    }
    if (config.grid_profile.empty() || robots.empty()) return;
    if (std::ranges::find(robots, config.grid_profile, &RobotProfile::name) != robots.end()) return;
    section.fault("grid_profile", "'" + config.grid_profile +
                                      "' is not one of traversability.profiles; empty: no grid");
  } catch (const ConfigError& error) {
    for (const std::string& fault : error.faults()) section.fault("profiles", fault);
  }
}

std::vector<RobotProfile> load_robots(const TraversabilityConfig& config) {
  std::vector<RobotProfile> robots;
  std::vector<std::string> faults;
  for (const std::string& profile : config.profiles) {
    try {
      RobotProfile robot = load_robot_profile(profile);
      if (std::ranges::find(robots, robot.name, &RobotProfile::name) != robots.end()) {
        faults.push_back("two robots are called '" + robot.name + "'; clients ask by name");
      }
      robots.push_back(std::move(robot));
    } catch (const ConfigError& error) {
      faults.insert(faults.end(), error.faults().begin(), error.faults().end());
    }
  }
  if (!faults.empty()) throw ConfigError(faults);
  return robots;
}

}  // namespace stillmap
