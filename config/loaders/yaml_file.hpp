#pragma once

#include <yaml-cpp/node/node.h>

#include <filesystem>
#include <string>

#include "config/loaders/config_report.hpp"

namespace stillmap {

/// A YAML file as it was parsed, and what was found in reading it.
struct YamlFile {
  std::filesystem::path file;
  YAML::Node root;
  ConfigReport report;

  /// Notes a fault at the line of `node`.
  void fault(const YAML::Node& node, const std::string& field, const std::string& text);
  void fault_at(const YAML::Mark& mark, const std::string& field, const std::string& text);
  /// Throws ConfigError when there are faults.
  void require_no_faults() const;
};

/// Parses a file. Throws ConfigError when it cannot be read or is not one YAML mapping.
[[nodiscard]] YamlFile open_yaml(const std::filesystem::path& file);

}  // namespace stillmap
