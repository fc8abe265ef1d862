#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "config/loaders/config_error.hpp"
#include "core/traversability/robot_profile.hpp"

namespace stillmap {

/// Reads a robot file like those in config/robots. Throws ConfigError with every fault.
[[nodiscard]] RobotProfile read_robot_profile(const std::filesystem::path& file);

/// A robot by its name (car, delivery_robot, tracked: a file NAME.yaml in a folder of robots), or
/// by its file. Throws ConfigError with every fault, or with the names that there are.
[[nodiscard]] RobotProfile load_robot_profile(const std::string& name_or_file);

/// As load_robot_profile takes it: a file's relative name then starts at `folder`.
[[nodiscard]] std::string robot_from(const std::filesystem::path& folder,
                                     const std::string& name_or_file);

}  // namespace stillmap
