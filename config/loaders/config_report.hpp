#pragma once

#include <algorithm>
#include <string>
#include <string_view>
#include <vector>

namespace stillmap {

/// What was found in reading a configuration file. Fields are named by their path in the file
/// ("publish.scan").
struct ConfigReport {
  /// One line each: file and line, field, value, what is allowed.
  std::vector<std::string> faults;
  /// Fields that the file leaves out: they keep their default.
  std::vector<std::string> left_out;
  /// Number fields for which the file has a word, such as "sensor", instead of a number.
  std::vector<std::string> by_word;
  /// Fields that the file sets to something else than the default.
  std::vector<std::string> changed;
};

/// Whether the file leaves this field out, or has a word for it.
[[nodiscard]] inline bool is_left_open(const ConfigReport& report, std::string_view field) {
  return std::ranges::find(report.left_out, field) != report.left_out.end() ||
         std::ranges::find(report.by_word, field) != report.by_word.end();
}

}  // namespace stillmap
