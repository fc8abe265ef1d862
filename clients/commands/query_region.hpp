#pragma once

#include <Eigen/Geometry>
#include <chrono>
#include <vector>

#include "clients/client.hpp"
#include "clients/terminal/command_line.hpp"

namespace stillmap {

/// How a command line names a region of the map; nothing given means everything. [m], map frame.
struct RegionArguments {
  /// x_min y_min z_min x_max y_max z_max.
  std::vector<double> box;
  /// x y size: a square column.
  std::vector<double> around;
  /// Size of a square column round the robot; 0: not asked for.
  double around_robot_m = 0.0;
};

/// Adds --box, --around and --around-robot, of which one may be given.
void add_region_options(CommandHandle command, RegionArguments& region);

/// The region as a box. Throws ServiceTimeout when the robot's pose is needed and does not arrive
/// in time.
[[nodiscard]] Eigen::AlignedBox3d box_of(const RegionArguments& region, Client& client,
                                         std::chrono::milliseconds timeout);

}  // namespace stillmap
