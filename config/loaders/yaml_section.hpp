#pragma once

#include <yaml-cpp/node/node.h>

#include <concepts>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "config/loaders/yaml_file.hpp"

namespace stillmap {

/// Allowed values, both ends included.
struct Range {
  double min;
  double max;
};

/// One mapping of a YAML file, read field by field into values that hold their defaults. A fault
/// goes into the file's report and leaves the value as it was. When the section goes out of scope,
/// every name in it that was not read is a fault.
class YamlSection {
 public:
  /// The whole file.
  explicit YamlSection(YamlFile& file);
  ~YamlSection();
  YamlSection(const YamlSection&) = delete;
  YamlSection& operator=(const YamlSection&) = delete;

  [[nodiscard]] YamlSection section(const std::string& name);

  /// Calls `read(YamlSection)` for every section of a list.
  template <typename Read>
  void sections(const std::string& name, Read read) {
    const auto items = read_list(name, "sections with fields");
    if (!items) return;
    for (std::size_t i = 0; i < items->size(); ++i) {
      read(item_section(name + "[" + std::to_string(i) + "]", (*items)[i]));
    }
  }

  /// Whether the file has the field.
  [[nodiscard]] bool has(const std::string& name) const;

  /// Each of these fields that the file leaves out is a fault.
  void require(const std::vector<std::string>& names);

  template <std::floating_point T>
  void number(const std::string& name, T& value, Range allowed) {
    if (const auto read = read_number(name, allowed)) assign(name, value, static_cast<T>(*read));
  }
  /// As number(); a file that says `word` keeps the default, and is_left_open().
  void number_or(const std::string& word, const std::string& name, double& value, Range allowed);
  template <std::integral T>
  void integer(const std::string& name, T& value, Range allowed) {
    if (const auto read = read_integer(name, allowed)) assign(name, value, static_cast<T>(*read));
  }
  void number_list(const std::string& name, std::vector<double>& values, Range allowed);
  /// The file has degrees, `radians` does not; `allowed_deg` is in degrees.
  void degrees(const std::string& name, double& radians, Range allowed_deg);
  void degrees_list(const std::string& name, std::vector<double>& radians, Range allowed_deg);
  /// true or false.
  void boolean(const std::string& name, bool& value);
  /// False where there is none, or no text.
  bool text(const std::string& name, std::string& value);
  void text_list(const std::string& name, std::vector<std::string>& values);
  /// A relative path starts at the file's folder; nothing written is the empty path.
  void path(const std::string& name, std::filesystem::path& value);

  template <typename T>
  struct Choice {
    std::string name;
    T value;
  };
  /// One of a few words.
  template <typename T>
  void choice(const std::string& name, T& value, const std::vector<Choice<T>>& choices) {
    std::vector<std::string> words;
    words.reserve(choices.size());
    for (const Choice<T>& one : choices) words.push_back(one.name);
    if (const auto index = read_choice(name, words)) assign(name, value, choices[*index].value);
  }

  /// The names in this section, in the file's order, where names are data. All count as read.
  [[nodiscard]] std::vector<std::string> names();
  /// Reports a fault of the field `name`.
  void fault(const std::string& name, const std::string& text);
  /// Reports the lines of a `faults()` about the section's values.
  void faults(const std::string& lines);

 private:
  YamlSection(YamlFile& file, YAML::Node node, std::string path);

  [[nodiscard]] YamlSection item_section(const std::string& name, const YAML::Node& item);

  /// The field's node; nothing when the file leaves it out. The name is known from now on.
  std::optional<YAML::Node> field(const std::string& name);
  [[nodiscard]] std::string path_of(const std::string& name) const;
  [[nodiscard]] std::optional<double> read_number(const std::string& name, Range allowed);
  [[nodiscard]] std::optional<std::int64_t> read_integer(const std::string& name, Range allowed);
  [[nodiscard]] std::optional<std::size_t> read_choice(const std::string& name,
                                                       const std::vector<std::string>& words);
  [[nodiscard]] std::optional<std::vector<YAML::Node>> read_list(const std::string& name,
                                                                 const std::string& wanted);
  void check_names();

  template <typename T>
  void assign(const std::string& name, T& value, T read) {
    if (!(value == read)) file_.report.changed.push_back(path_of(name));
    value = std::move(read);
  }

  YamlFile& file_;
  YAML::Node node_;
  std::string path_;
  std::vector<std::string> known_;
};

}  // namespace stillmap
