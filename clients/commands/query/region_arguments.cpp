#include "clients/commands/query/region_arguments.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <system_error>

#include "clients/commands/query/fetch_map.hpp"

namespace stillmap::cli {
namespace {

/// The whole word as a number; also "nan" and "inf", which the region's own check refuses.
std::optional<double> number(const std::string& word) {
  try {
    std::size_t length = 0;
    const double value = std::stod(word, &length);
    if (length == word.size()) return value;
  } catch (const std::logic_error&) {
    // No number, or too large for one.
  }
  return std::nullopt;
}

/// The position in a line of a file; nothing for an empty line.
std::optional<Eigen::Vector2d> point_in_line(std::string line, const std::string& where) {
  line.resize(std::min(line.find('#'), line.size()));
  std::ranges::replace(line, ',', ' ');
  std::istringstream words(line);
  std::vector<std::string> parts;
  for (std::string word; words >> word;) parts.push_back(word);
  if (parts.empty()) return std::nullopt;
  const auto x = number(parts[0]);
  const auto y = parts.size() == 2 ? number(parts[1]) : std::nullopt;
  if (!x || !y) throw std::invalid_argument(where + ": '" + line + "' is not two numbers, x y");
  return Eigen::Vector2d(*x, *y);
}

std::vector<Eigen::Vector2d> points_in_file(const std::string& option, const std::string& file) {
  std::ifstream in(file);
  if (!in) {
    throw std::invalid_argument(option + " " + file +
                                ": neither numbers, x y x y and so on, nor a file to be read");
  }
  std::error_code unknown;
  if (std::filesystem::is_directory(file, unknown))
    throw std::invalid_argument(option + " " + file + ": is a folder; name a file of points in it");
  std::vector<Eigen::Vector2d> points;
  int line_number = 0;
  for (std::string line; std::getline(in, line);) {
    const std::string where = std::string(option).append(" ").append(file).append(" line ").append(
        std::to_string(++line_number));
    if (const auto point = point_in_line(line, where)) points.push_back(*point);
  }
  return points;
}

BoxRegion column(double x, double y, double size_m, const HeightRange& heights) {
  const double half = size_m / 2.0;
  BoxRegion box;
  box.box_map = {Eigen::Vector3d(x - half, y - half, heights.min_m),
                 Eigen::Vector3d(x + half, y + half, heights.max_m)};
  return box;
}

Region chosen_region(const RegionArguments& region, const Eigen::Vector2d& robot_map) {
  const HeightRange heights{region.min_z_m, region.max_z_m};
  if (!region.box.empty()) {
    BoxRegion box;
    box.box_map = {Eigen::Vector3d(region.box[0], region.box[1], region.box[2]),
                   Eigen::Vector3d(region.box[3], region.box[4], region.box[5])};
    return box;
  }
  if (!region.sphere.empty()) {
    return SphereRegion{.centre_map = {region.sphere[0], region.sphere[1], region.sphere[2]},
                        .radius_m = region.sphere[3]};
  }
  if (!region.polygon.empty()) {
    return PolygonRegion{.corners_map = parse_points_2d("--polygon", region.polygon),
                         .heights = heights};
  }
  if (!region.corridor.empty()) {
    return CorridorRegion{.path_map = parse_points_2d("--corridor", region.corridor),
                          .half_width_m = region.width_m / 2.0,
                          .heights = heights};
  }
  if (!region.around.empty()) {
    return column(region.around[0], region.around[1], region.around[2], heights);
  }
  if (region.around_robot_m > 0.0) {
    return column(robot_map.x(), robot_map.y(), region.around_robot_m, heights);
  }
  BoxRegion everything;
  everything.box_map.min().z() = heights.min_m;
  everything.box_map.max().z() = heights.max_m;
  return everything;
}

/// The options whose values include heights.
struct Kinds {
  OptionHandle box;
  OptionHandle sphere;
};

Kinds add_kinds(CommandHandle command, RegionArguments& region) {
  std::array kinds{
      command.option("--box", region.box, "x_min y_min z_min x_max y_max z_max")
          .exactly(6)
          .comma_separated(),
      command.option("--around", region.around, "x y SIZE: a square").exactly(3).comma_separated(),
      command.option("--around-robot", region.around_robot_m, "SIZE: a square round the robot")
          .above_zero(),
      command.option("--sphere", region.sphere, "x y z RADIUS").exactly(4).comma_separated(),
      command.option("--polygon", region.polygon,
                     "x y x y ...: corners round an outline; or FILE with a corner a line"),
      command.option("--corridor", region.corridor,
                     "x y x y ...: all within --width of a path; or FILE with a point a line")};
  for (std::size_t i = 0; i < kinds.size(); ++i) {
    for (std::size_t j = i + 1; j < kinds.size(); ++j) kinds.at(i).excludes(kinds.at(j));
  }
  command.option("--width", region.width_m, "Whole width of the corridor [m]")
      .above_zero()
      .needs(kinds[5]);
  return {.box = kinds[0], .sphere = kinds[3]};
}

}  // namespace

std::vector<Eigen::Vector2d> parse_points_2d(const std::string& option,
                                             const std::vector<std::string>& words) {
  std::vector<double> values;
  for (const std::string& word : words) {
    std::istringstream parts(word);
    for (std::string part; std::getline(parts, part, ',');) {
      const auto value = number(part);
      if (!value && words.size() == 1) return points_in_file(option, word);
      if (!value) throw std::invalid_argument(option + ": '" + word + "' is not a number");
      values.push_back(*value);
    }
  }
  if (values.empty() && !words.empty()) return points_in_file(option, words.front());
  if (values.size() % 2 != 0) {
    throw std::invalid_argument(option + " has " + std::to_string(values.size()) +
                                " numbers; give an x and a y for every point");
  }
  std::vector<Eigen::Vector2d> points;
  for (std::size_t i = 0; i < values.size(); i += 2) points.emplace_back(values[i], values[i + 1]);
  return points;
}

void add_region_options_2d(CommandHandle command, RegionArguments& region) {
  static_cast<void>(add_kinds(command, region));
}

void add_region_options(CommandHandle command, RegionArguments& region) {
  const Kinds kinds = add_kinds(command, region);
  command.option("--min-z", region.min_z_m, "Lowest height [m]; not with --box, --sphere")
      .excludes(kinds.box)
      .excludes(kinds.sphere);
  command.option("--max-z", region.max_z_m, "Greatest height [m]; not with --box, --sphere")
      .excludes(kinds.box)
      .excludes(kinds.sphere);
}

Region region_at(const RegionArguments& arguments, const Eigen::Vector2d& robot_map) {
  if (!arguments.corridor.empty() && arguments.width_m == 0.0) {
    throw std::invalid_argument("--corridor needs --width, the corridor's whole width [m]");
  }
  if (!arguments.around.empty() && !(arguments.around[2] > 0.0)) {
    std::ostringstream size;
    size << arguments.around[2];
    throw std::invalid_argument("--around has the SIZE " + size.str() +
                                "; it must be above 0 m, the side of a square");
  }
  Region region = chosen_region(arguments, robot_map);
  if (const std::string faults = region_faults(region); !faults.empty()) {
    throw std::invalid_argument(faults);
  }
  return region;
}

void check_region(const RegionArguments& region) {
  static_cast<void>(region_at(region, Eigen::Vector2d::Zero()));
}

Region region_of(const RegionArguments& region, Client& client, std::chrono::milliseconds timeout) {
  Eigen::Vector2d robot_map = Eigen::Vector2d::Zero();
  if (region.around_robot_m > 0.0) {
    robot_map = fetch_trajectory(client, timeout).back().T_map_lidar.translation().head<2>();
  }
  return region_at(region, robot_map);
}

std::bitset<semantic_class_count> classes_of(const std::vector<std::string>& names) {
  std::bitset<semantic_class_count> classes;
  for (const std::string& class_name : names) {
    const std::optional<SemanticClass> label = class_from_name(class_name);
    if (!label) {
      std::string known;
      for (std::size_t k = 0; k < semantic_class_count; ++k) {
        known.append(" ").append(name(static_cast<SemanticClass>(k)));
      }
      throw std::invalid_argument("class '" + class_name + "' is not known; there are:" + known);
    }
    classes.set(static_cast<std::size_t>(*label));
  }
  return classes;
}

}  // namespace stillmap::cli
