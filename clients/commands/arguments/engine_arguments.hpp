#pragma once

#include <cstdint>
#include <string>

#include "clients/terminal/command_line.hpp"
#include "core/segmentation/open_network.hpp"

namespace stillmap::cli {

/// How a command line says what runs a network; empty: as configured.
struct EngineArguments {
  std::string engine;
  std::string precision;
  /// 0: as configured.
  std::uint32_t threads = 0;
};

/// Adds --engine, --precision and --threads.
void add_engine_options(CommandHandle command, EngineArguments& arguments);

/// Puts what the command line says in place of `choice`.
void set_engine(const EngineArguments& arguments, EngineOptions& choice);

}  // namespace stillmap::cli
