#pragma once

#include <cstdint>
#include <string>

namespace stillmap::dds {

/// How much a diagnostic matters, in the numbers of diagnostic_msgs/DiagnosticStatus (WARN, ERROR).
enum class Severity : std::uint8_t {
  /// It works, but may not for long, or not as fast as it could.
  advice = 1,
  /// It keeps data from flowing.
  problem = 2,
};

/// Something that is wrong, with what shows it and what would help.
struct Diagnostic {
  Severity severity = Severity::problem;
  /// One line: "no scans: nobody publishes rt/points".
  std::string what;
  /// What was seen.
  std::string evidence;
  /// What to do.
  std::string hint;
};

}  // namespace stillmap::dds
