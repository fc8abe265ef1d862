#include "clients/commands/query_region.hpp"

#include <limits>

#include "clients/commands/map_snapshot.hpp"

namespace stillmap {
namespace {

constexpr double everywhere = std::numeric_limits<double>::infinity();

Eigen::AlignedBox3d column(double x, double y, double size_m) {
  const double half = size_m / 2.0;
  return {Eigen::Vector3d(x - half, y - half, -everywhere),
          Eigen::Vector3d(x + half, y + half, everywhere)};
}

}  // namespace

void add_region_options(CommandHandle command, RegionArguments& region) {
  OptionHandle box =
      command.option("--box", region.box, "x_min y_min z_min x_max y_max z_max").exactly(6);
  OptionHandle around =
      command.option("--around", region.around, "x y SIZE: a square, all heights").exactly(3);
  OptionHandle around_robot = command
                                  .option("--around-robot", region.around_robot_m,
                                          "SIZE: a square round the robot, all heights")
                                  .above_zero();
  box.excludes(around).excludes(around_robot);
  around.excludes(around_robot);
}

Eigen::AlignedBox3d box_of(const RegionArguments& region, Client& client,
                           std::chrono::milliseconds timeout) {
  if (!region.box.empty()) {
    return {Eigen::Vector3d(region.box[0], region.box[1], region.box[2]),
            Eigen::Vector3d(region.box[3], region.box[4], region.box[5])};
  }
  if (!region.around.empty()) return column(region.around[0], region.around[1], region.around[2]);
  if (region.around_robot_m > 0.0) {
    const Eigen::Vector3d position = newest_path(client, timeout).back().T_map_lidar.translation();
    return column(position.x(), position.y(), region.around_robot_m);
  }
  return {Eigen::Vector3d::Constant(-everywhere), Eigen::Vector3d::Constant(everywhere)};
}

}  // namespace stillmap
