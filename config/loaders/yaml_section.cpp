#include "config/loaders/yaml_section.hpp"

#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>
#include <sstream>
#include <string_view>

#include "config/loaders/closest_name.hpp"
#include "core/lidar/angle_units.hpp"

namespace stillmap {
namespace {

/// Fields that had another name in the same section, by their path in the file.
struct RenamedField {
  std::string_view old_path;
  std::string_view path;
};
constexpr RenamedField renamed_fields[] = {
    {"areas", "traversability"},
    {"bulk_bytes_per_s", "large_message_bytes_per_s"},
    {"image.least_columns", "image.min_columns"},
    {"occupancy.clear_every", "occupancy.clearing_interval"},
    {"occupancy.clear_margin_m", "occupancy.clearing_margin_m"},
    {"occupancy.clear_margin_share", "occupancy.clearing_margin_share"},
    {"occupancy.clear_range_m", "occupancy.clearing_range_m"},
    {"odometry.motion.past_view_interval", "odometry.motion.range_image_history_interval"},
    {"odometry.motion.past_views", "odometry.motion.range_image_history_size"},
    {"odometry.motion.use_past_views", "odometry.motion.use_range_image_history"},
    {"static_map.clear_margin_m", "static_map.clearing_margin_m"},
    {"static_map.clear_margin_share", "static_map.clearing_margin_share"},
    {"static_map.clear_range_m", "static_map.clearing_range_m"},
    {"static_map.look_every", "static_map.clearing_interval"},
    {"static_map.passes", "static_map.misses_to_clear"},
    {"static_map.passes_per_hit", "static_map.misses_per_hit"},
};

/// What a fault says of a name that is no field. `known`: the names that can be used there.
std::string unknown_field(const std::string& path, const std::string& name,
                          const std::vector<std::string>& known) {
  // The table holds for files of all kinds, and a path can mean nothing in this one.
  const auto is_known_here = [&](const RenamedField& field) {
    return std::ranges::find(known, field.path.substr(field.path.rfind('.') + 1)) != known.end();
  };
  const auto renamed = std::ranges::find(renamed_fields, path, &RenamedField::old_path);
  if (renamed != std::end(renamed_fields) && is_known_here(*renamed)) {
    return "is now called '" + std::string(renamed->path) + "'";
  }
  return "there is no such field" + did_you_mean(name, known);
}

/// The value as a fault shows it: short, and on one line.
std::string shown(const YAML::Node& node) {
  if (node.IsMap()) return "a mapping";
  if (node.IsSequence()) return "a list";
  if (!node.IsScalar()) return "nothing";
  constexpr std::size_t longest = 60;
  std::string text(1, '\'');
  text += node.Scalar().substr(0, longest);
  return text + (node.Scalar().size() > longest ? "...'" : "'");
}

std::string shown(Range allowed) {
  std::ostringstream text;
  text.precision(12);
  text << allowed.min << " to " << allowed.max;
  return text.str();
}

bool has_null_character(const YAML::Node& node) {
  return node.IsScalar() && node.Scalar().find('\0') != std::string::npos;
}

template <typename T>
std::optional<T> parsed(const YAML::Node& node) {
  if (!node.IsScalar()) return std::nullopt;
  const std::string& text = node.Scalar();
  T value{};
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  if (error != std::errc{} || stop != end) return std::nullopt;
  return value;
}

std::optional<double> number_in(const YAML::Node& node, Range allowed) {
  const std::optional<double> value = parsed<double>(node);
  // Written so that NaN fails.
  if (!value || !(*value >= allowed.min && *value <= allowed.max)) return std::nullopt;
  return value;
}

bool near(double a, double b) { return std::abs(a - b) <= 1e-12; }

}  // namespace

YamlSection::YamlSection(YamlFile& file) : YamlSection(file, file.root, "") {}

YamlSection::YamlSection(YamlFile& file, YAML::Node node, std::string path)
    : file_(file), node_(std::move(node)), path_(std::move(path)) {}

YamlSection::~YamlSection() { check_names(); }

bool YamlSection::has(const std::string& name) const {
  const YAML::Node& node = node_;
  return node[name].IsDefined();
}

YamlSection YamlSection::item_section(const std::string& name, const YAML::Node& item) {
  if (!item.IsMap()) {
    file_.fault(item, path_of(name), shown(item) + " is not allowed; a section with fields");
  }
  return {file_, item.IsMap() ? item : YAML::Node(YAML::NodeType::Map), path_of(name)};
}

YamlSection YamlSection::section(const std::string& name) {
  const std::optional<YAML::Node> node = field(name);
  // A section whose lines are all commented out is null: every field keeps its default.
  if (node && !node->IsMap() && !node->IsNull()) {
    file_.fault(*node, path_of(name), shown(*node) + " is not allowed; a section with fields");
  }
  const bool usable = node && node->IsMap();
  return {file_, usable ? *node : YAML::Node(YAML::NodeType::Map), path_of(name)};
}

void YamlSection::require(const std::vector<std::string>& names) {
  const YAML::Node& node = node_;
  for (const std::string& name : names) {
    if (!node[name].IsDefined()) fault(name, "is missing");
  }
}

std::optional<YAML::Node> YamlSection::field(const std::string& name) {
  known_.push_back(name);
  const YAML::Node& node = node_;
  YAML::Node value = node[name];
  if (value.IsDefined()) return value;
  file_.report.left_out.push_back(path_of(name));
  return std::nullopt;
}

std::string YamlSection::path_of(const std::string& name) const {
  return path_.empty() ? name : path_ + "." + name;
}

void YamlSection::number_or(const std::string& word, const std::string& name, double& value,
                            Range allowed) {
  const std::optional<YAML::Node> node = field(name);
  if (!node) return;
  const std::optional<double> read = number_in(*node, allowed);
  if (read) {
    assign(name, value, *read);
  } else if (node->IsScalar() && node->Scalar() == word) {
    file_.report.by_word.push_back(path_of(name));
  } else {
    fault(name,
          shown(*node) + " is not allowed; '" + word + "', or a number from " + shown(allowed));
  }
}

std::optional<double> YamlSection::read_number(const std::string& name, Range allowed) {
  const std::optional<YAML::Node> node = field(name);
  if (!node) return std::nullopt;
  const std::optional<double> value = number_in(*node, allowed);
  if (!value) fault(name, shown(*node) + " is not allowed; a number from " + shown(allowed));
  return value;
}

std::optional<std::int64_t> YamlSection::read_integer(const std::string& name, Range allowed) {
  const std::optional<YAML::Node> node = field(name);
  if (!node) return std::nullopt;
  const std::optional<std::int64_t> value = parsed<std::int64_t>(*node);
  const bool inside = value && static_cast<double>(*value) >= allowed.min &&
                      static_cast<double>(*value) <= allowed.max;
  if (inside) return value;
  fault(name, shown(*node) + " is not allowed; a whole number from " + shown(allowed));
  return std::nullopt;
}

std::optional<std::size_t> YamlSection::read_choice(const std::string& name,
                                                    const std::vector<std::string>& words) {
  const std::optional<YAML::Node> node = field(name);
  if (!node) return std::nullopt;
  const std::string word = node->IsScalar() ? node->Scalar() : "";
  const auto found = std::ranges::find(words, word);
  if (found != words.end()) return static_cast<std::size_t>(found - words.begin());
  fault(name, shown(*node) + " is not allowed" + did_you_mean(word, words));
  return std::nullopt;
}

std::optional<std::vector<YAML::Node>> YamlSection::read_list(const std::string& name,
                                                              const std::string& wanted) {
  const std::optional<YAML::Node> node = field(name);
  if (!node) return std::nullopt;
  if (!node->IsSequence()) {
    fault(name, shown(*node) + " is not allowed; a list of " + wanted);
    return std::nullopt;
  }
  return std::vector<YAML::Node>(node->begin(), node->end());
}

void YamlSection::number_list(const std::string& name, std::vector<double>& values, Range allowed) {
  const auto items = read_list(name, "numbers");
  if (!items) return;
  std::vector<double> read;
  for (const YAML::Node& item : *items) {
    if (const std::optional<double> value = number_in(item, allowed)) {
      read.push_back(*value);
    } else {
      file_.fault(item, path_of(name),
                  shown(item) + " is not allowed; numbers from " + shown(allowed));
    }
  }
  if (read.size() == items->size()) assign(name, values, std::move(read));
}

void YamlSection::degrees(const std::string& name, double& radians, Range allowed_deg) {
  const std::optional<double> value_deg = read_number(name, allowed_deg);
  if (!value_deg) return;
  // The way through degrees costs the last digit; that is no change.
  const double read = *value_deg * rad_per_deg;
  assign(name, radians, near(read, radians) ? radians : read);
}

void YamlSection::degrees_list(const std::string& name, std::vector<double>& radians,
                               Range allowed_deg) {
  std::vector<double> read = radians;
  for (double& value : read) value /= rad_per_deg;
  const std::size_t changes = file_.report.changed.size();
  number_list(name, read, allowed_deg);
  for (double& value : read) value *= rad_per_deg;
  if (std::ranges::equal(read, radians, near)) file_.report.changed.resize(changes);
  radians = std::move(read);
}

void YamlSection::boolean(const std::string& name, bool& value) {
  const auto index = read_choice(name, {"false", "true"});
  if (index) assign(name, value, *index == 1);
}

bool YamlSection::text(const std::string& name, std::string& value) {
  const std::optional<YAML::Node> node = field(name);
  if (!node) return false;
  const bool has_text = node->IsScalar() || node->IsNull();
  if (has_text && has_null_character(*node)) {
    fault(name, "has a character \\0, at which names of files and topics would end");
  } else if (has_text) {
    assign(name, value, node->IsNull() ? std::string() : node->Scalar());
    return true;
  } else {
    fault(name, shown(*node) + " is not allowed; a text");
  }
  return false;
}

void YamlSection::text_list(const std::string& name, std::vector<std::string>& values) {
  const auto items = read_list(name, "texts");
  if (!items) return;
  std::vector<std::string> read;
  for (const YAML::Node& item : *items) {
    if (item.IsScalar() && !item.Scalar().empty() && !has_null_character(item)) {
      read.push_back(item.Scalar());
    } else {
      file_.fault(item, path_of(name), shown(item) + " is not allowed; texts that are not empty");
    }
  }
  if (read.size() == items->size()) assign(name, values, std::move(read));
}

void YamlSection::path(const std::string& name, std::filesystem::path& value) {
  std::string written = value.string();
  text(name, written);
  const std::filesystem::path read = written;
  value = read.empty() || read.is_absolute() ? read : file_.file.parent_path() / read;
}

std::vector<std::string> YamlSection::names() {
  std::vector<std::string> names;
  for (const auto& entry : node_) {
    if (entry.first.IsScalar()) names.push_back(entry.first.Scalar());
  }
  known_.insert(known_.end(), names.begin(), names.end());
  return names;
}

void YamlSection::fault(const std::string& name, const std::string& text) {
  const YAML::Node& node = node_;
  const YAML::Node value = node[name];
  file_.fault(value.IsDefined() ? value : node, path_of(name), text);
}

void YamlSection::faults(const std::string& lines) {
  std::istringstream stream(lines);
  for (std::string line; std::getline(stream, line);) file_.fault(node_, path_, line);
}

void YamlSection::check_names() {
  std::set<std::string> seen;
  for (const auto& entry : node_) {
    if (!entry.first.IsScalar()) {
      file_.fault(entry.first, path_, shown(entry.first) + " is not allowed as a name");
      continue;
    }
    const std::string name = entry.first.Scalar();
    if (!seen.insert(name).second) {
      file_.fault(entry.first, path_of(name), "is written twice");
    } else if (std::ranges::find(known_, name) == known_.end()) {
      file_.fault(entry.first, path_of(name), unknown_field(path_of(name), name, known_));
    }
  }
}

}  // namespace stillmap
