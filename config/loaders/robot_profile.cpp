#include "config/loaders/robot_profile.hpp"

#include <array>
#include <charconv>

#include "config/loaders/named_file.hpp"
#include "config/loaders/yaml_section.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

/// A cost is a number or the word 'lethal'.
void read_cost(YamlSection& section, SemanticClass label, RobotProfile& profile) {
  const std::string field(name(label));
  std::string text = "lethal";
  section.text(field, text);
  std::optional<double>& cost = profile.class_cost.at(static_cast<std::size_t>(label));
  if (text == "lethal") {
    cost = std::nullopt;
    return;
  }
  double value = 0.0;
  const char* const end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data(), end, value);
  const bool is_cost = error == std::errc{} && stop == end && value >= 0.0 && value <= 1.0;
  if (is_cost) {
    cost = value;
  } else {
    section.fault(field, "'" + text + "' is not allowed; a number from 0 to 1, or lethal");
  }
}

void read_costs(YamlSection section, RobotProfile& profile) {
  constexpr std::array grounds{SemanticClass::road,     SemanticClass::parking,
                               SemanticClass::sidewalk, SemanticClass::other_ground,
                               SemanticClass::terrain,  SemanticClass::unlabeled};
  std::vector<std::string> names;
  for (const SemanticClass label : grounds) names.emplace_back(name(label));
  section.require(names);
  for (const SemanticClass label : grounds) read_cost(section, label, profile);
}

void read_profile(YamlSection file, RobotProfile& profile) {
  file.require({"name", "length_m", "width_m", "ground_clearance_m", "height_m", "max_step_m",
                "max_slope_deg", "max_roughness_m", "class_cost"});
  file.text("name", profile.name);
  file.number("length_m", profile.length_m, {0.05, 20});
  file.number("width_m", profile.width_m, {0.05, 20});
  file.number("centre_ahead_m", profile.centre_ahead_m, {-10, 10});
  file.number("min_turning_radius_m", profile.min_turning_radius_m, {0, 50});
  file.number("ground_clearance_m", profile.ground_clearance_m, {0, 2});
  file.number("height_m", profile.height_m, {0.05, 10});
  file.number("max_step_m", profile.max_step_m, {0.01, 2});
  file.number("max_slope_deg", profile.max_slope_deg, {1, 60});
  file.number("max_roughness_m", profile.max_roughness_m, {0.001, 1});
  file.number("inferred_cost", profile.inferred_cost, {0, 1});
  file.choice<UnknownGround>(
      "unknown", profile.unknown,
      {{"blocked", UnknownGround::blocked}, {"allowed", UnknownGround::allowed}});
  read_costs(file.section("class_cost"), profile);
  file.faults(profile.faults());
}

NamedFileSearchPaths robot_search_paths() {
  return {.kind = "robot",
          .variable = "STILLMAP_ROBOTS",
          .share = "robots",
          .sources = STILLMAP_ROBOT_SOURCES};
}

}  // namespace

RobotProfile read_robot_profile(const fs::path& file) {
  YamlFile yaml = open_yaml(file);
  RobotProfile profile;
  read_profile(YamlSection(yaml), profile);
  yaml.require_no_faults();
  return profile;
}

std::string robot_from(const fs::path& folder, const std::string& name_or_file) {
  return is_file_name(name_or_file) ? (folder / name_or_file).string() : name_or_file;
}

RobotProfile load_robot_profile(const std::string& name_or_file) {
  return read_robot_profile(find_named_file(robot_search_paths(), name_or_file));
}

}  // namespace stillmap
