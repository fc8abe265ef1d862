#pragma once

#include <cstdio>
#include <exception>
#include <functional>

#include "clients/terminal/command_line.hpp"

namespace stillmap::bench {

/// Parses the command line, then runs the benchmark, unless help was asked for; an exception
/// becomes a line on stderr. Returns the exit code of the program.
[[nodiscard]] inline int run_program(cli::CommandLine& line, int argc, char** argv,
                                     const std::function<void()>& benchmark) {
  switch (line.parse(argc, argv)) {
    case cli::CommandLine::Parsed::answered:
      return 0;
    case cli::CommandLine::Parsed::wrong_usage:
      return 2;
    case cli::CommandLine::Parsed::command:
      break;
  }
  try {
    benchmark();
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "%s: %s\n", argv[0], error.what());
    return 1;
  }
}

}  // namespace stillmap::bench
