#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace stillmap {

/// Where the YAML files of one kind that come with Stillmap are looked for, in this order.
struct NamedFileSearchPaths {
  /// Of one file, in messages: "robot".
  std::string kind;
  /// The environment variable that may name a folder.
  std::string variable;
  /// The folder in share/stillmap beside the program's folder.
  std::string share;
  /// The folder in the sources.
  std::filesystem::path sources;
};

/// Whether the text means a file and not a name: it has a slash or ends with .yaml or .yml.
[[nodiscard]] bool is_file_name(const std::string& name_or_file);

/// The file that the text means. Throws ConfigError with the names that there are.
[[nodiscard]] std::filesystem::path find_named_file(const NamedFileSearchPaths& search_paths,
                                                    const std::string& name_or_file);

}  // namespace stillmap
