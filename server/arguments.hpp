#pragma once

#include <optional>

#include "config/loaders/server_config.hpp"

namespace stillmap::server {

/// The configuration that the command line asks for; nothing when it only asked for help, the
/// version or a check, which were printed then.
struct Arguments {
  std::optional<ServerConfig> config;
  /// For the shell, when there is no configuration.
  int exit_code = 0;
};

/// Throws ConfigError, and when a file is checked ModelError.
[[nodiscard]] Arguments read_arguments(int argc, char** argv);

}  // namespace stillmap::server
