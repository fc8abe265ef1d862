#pragma once

#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

namespace stillmap {

/// A configuration file that cannot be used. `what()` holds every fault found, one a line, each
/// with file and line, field, value and what would do.
class ConfigError : public std::runtime_error {
 public:
  explicit ConfigError(std::vector<std::string> faults)
      : std::runtime_error(joined(faults)), faults_(std::move(faults)) {}

  [[nodiscard]] const std::vector<std::string>& faults() const { return faults_; }

 private:
  static std::string joined(const std::vector<std::string>& faults) {
    std::string text;
    for (const std::string& fault : faults) text += (text.empty() ? "" : "\n") + fault;
    return text;
  }

  std::vector<std::string> faults_;
};

}  // namespace stillmap
