#include "clients/commands/arguments/simulation_arguments.hpp"

#include <cmath>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "config/loaders/sensor_file.hpp"
#include "core/simulation/training_city.hpp"

namespace stillmap::cli {
namespace {

/// Throws std::invalid_argument for a factor out of its limits.
void scale(simulation::TrafficPlan& traffic, double factor) {
  // Written so that NaN fails.
  if (!(factor >= 0.0 && factor <= 10.0)) {
    throw std::invalid_argument("the factor on traffic is " + std::to_string(factor) +
                                "; it must be 0 to 10");
  }
  traffic.vehicles_per_km *= factor;
  traffic.cyclists_per_km *= factor;
  traffic.pedestrians_per_km *= factor;
  traffic.crossing_pedestrians =
      static_cast<int>(std::lround(factor * traffic.crossing_pedestrians));
  traffic.escorted = traffic.escorted && factor > 0.0;
}

// Not a plan of its own: city, materials and the lidar's flaws are drawn from the seed.
constexpr const char* any_preset = "any";

simulation::CityPlan plan_of(const std::string& preset) {
  try {
    return simulation::city_plan(preset);
  } catch (const std::invalid_argument& unknown) {
    throw std::invalid_argument(std::string(unknown.what()) + " '" + any_preset +
                                "' draws one by the seed.");
  }
}

// hdl64 and vlp16 are what people type.
std::string sensor_name(const std::string& written) {
  if (written == "hdl64") return "hdl_64e";
  if (written == "hdl32") return "hdl_32e";
  if (written == "vlp16") return "vlp_16";
  return written;
}

/// Faults of a configuration, in the words of the options that set it.
std::string in_options(std::string faults) {
  const std::pair<std::string_view, std::string_view> names[] = {
      {"simulation.T_base_lidar.z", "--mount: z, the lidar's height above the ground [m],"},
      {"simulation.scans", "--scans"},
      {"simulation.sensor", "--sensor"}};
  for (const auto& [field, option] : names) {
    if (const std::size_t at = faults.find(field); at != std::string::npos)
      faults.replace(at, field.size(), option);
  }
  while (faults.ends_with('\n')) faults.pop_back();
  return faults;
}

}  // namespace

void check_seed(const std::string& option, std::uint64_t seed) {
  constexpr std::uint64_t last_seed = 1'000'000'000'000;
  if (seed <= last_seed) return;
  throw std::invalid_argument(option + " " + std::to_string(seed) +
                              " is negative or too large; it may be 0 to " +
                              std::to_string(last_seed));
}

simulation::SimulationConfig simulation_config(const SimulationArguments& arguments) {
  check_seed("--seed", arguments.seed);
  check_seed("--day", arguments.day);
  const SensorModel sensor = load_sensor(sensor_name(arguments.sensor));
  simulation::SimulationConfig config;
  if (arguments.preset == any_preset)
    config = simulation::any_sequence(arguments.seed, sensor);
  else
    config.plan = plan_of(arguments.preset);
  scale(config.plan.traffic, arguments.traffic);
  config.seed = arguments.seed;
  config.day = arguments.day;
  config.sensor = sensor;
  config.scans = arguments.scans;
  config.rolling = arguments.rolling;
  config.motion = simulation::lidar_motion(arguments.motion);
  config.T_base_lidar = arguments.mount.T_base_lidar();
  if (const std::string faults = config.faults(); !faults.empty()) {
    throw std::invalid_argument(in_options(faults));
  }
  return config;
}

}  // namespace stillmap::cli
