#pragma once

#include <string>
#include <vector>

namespace stillmap {

/// What was found in reading a configuration file. Fields are named by their path in the file
/// ("publish.scan").
struct ConfigReport {
  /// One line each: file and line, field, value, what is allowed.
  std::vector<std::string> faults;
  /// Fields that the file leaves out: they keep their default.
  std::vector<std::string> left_out;
  /// Fields that the file sets to something else than the default.
  std::vector<std::string> changed;
};

}  // namespace stillmap
