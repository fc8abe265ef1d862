#pragma once

#include <cstdint>
#include <string>

#include "core/simulation/simulation.hpp"

namespace stillmap {

/// How a command line asks for a simulated drive.
struct SimulationArguments {
  std::string preset = "quiet";
  /// A factor on everything that moves ("0.5"), or the name of a preset; empty: as the preset has.
  std::string traffic;
  std::string sensor = "hdl_64e";
  std::uint64_t seed = 1;
  int scans = 300;
  bool rolling = false;
};

/// Throws std::invalid_argument or ConfigError naming the value.
[[nodiscard]] SimulationConfig simulation_config(const SimulationArguments& arguments);

}  // namespace stillmap
