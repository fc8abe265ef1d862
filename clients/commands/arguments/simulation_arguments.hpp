#pragma once

#include <cstdint>
#include <string>

#include "clients/commands/arguments/mount_arguments.hpp"
#include "core/simulation/simulation.hpp"

namespace stillmap::cli {

/// How a command line asks for a simulated sequence.
struct SimulationArguments {
  std::string preset = "quiet";
  /// Factor on everything that moves, 0 to 10.
  double traffic = 1.0;
  std::string sensor = "hdl_64e";
  std::uint64_t seed = 1;
  std::uint64_t day = 0;
  int scans = 300;
  bool rolling = false;
  std::string motion = "vehicle";
  MountArguments mount;
};

/// A negative number that was typed comes as one near 2^64. Throws std::invalid_argument naming
/// the option.
void check_seed(const std::string& option, std::uint64_t seed);

/// Throws std::invalid_argument or ConfigError naming the value.
[[nodiscard]] simulation::SimulationConfig simulation_config(const SimulationArguments& arguments);

}  // namespace stillmap::cli
