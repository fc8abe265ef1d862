#pragma once

#include <bitset>
#include <chrono>
#include <limits>
#include <string>
#include <vector>

#include "clients/library/client.hpp"
#include "clients/terminal/command_line.hpp"
#include "core/lidar/semantic_class.hpp"

namespace stillmap::cli {

/// How a command line names a region of the map; nothing given means everything. [m], map frame.
struct RegionArguments {
  /// x_min y_min z_min x_max y_max z_max.
  std::vector<double> box;
  /// x y size: a square column.
  std::vector<double> around;
  /// Size of a square column round the robot; 0: not asked for.
  double around_robot_m = 0.0;
  /// x y z radius.
  std::vector<double> sphere;
  /// x y x y ..., or the name of a file of them.
  std::vector<std::string> polygon;
  std::vector<std::string> corridor;
  /// Of a corridor; 0: not given.
  double width_m = 0.0;
  /// Heights of all but boxes and spheres.
  double min_z_m = -std::numeric_limits<double>::infinity();
  double max_z_m = std::numeric_limits<double>::infinity();
};

/// Adds --box, --around, --around-robot, --sphere, --polygon and --corridor, of which one may be
/// given, and --width, --min-z and --max-z.
void add_region_options(CommandHandle command, RegionArguments& region);

/// The same without --min-z and --max-z, for regions that are seen from above.
void add_region_options_2d(CommandHandle command, RegionArguments& region);

/// Throws std::invalid_argument for what is no region, wherever the robot is.
void check_region(const RegionArguments& region);

/// The region of a robot that stands here. Throws as check_region does.
[[nodiscard]] Region region_at(const RegionArguments& region, const Eigen::Vector2d& robot_map);

/// Throws as check_region does, and ServiceTimeout when the robot's pose is needed and does not
/// arrive in time.
[[nodiscard]] Region region_of(const RegionArguments& region, Client& client,
                               std::chrono::milliseconds timeout);

/// Positions in plan: numbers two by two, or the name of a text file with a position a line (x y,
/// separated by blanks or commas; # begins a comment). `option` is for what it throws:
/// std::invalid_argument, naming option, file and line.
[[nodiscard]] std::vector<Eigen::Vector2d> parse_points_2d(const std::string& option,
                                                           const std::vector<std::string>& words);

/// The classes of these names. Throws std::invalid_argument listing the known ones.
[[nodiscard]] std::bitset<semantic_class_count> classes_of(const std::vector<std::string>& names);

}  // namespace stillmap::cli
