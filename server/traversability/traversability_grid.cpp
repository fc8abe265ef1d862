#include "server/traversability/traversability_grid.hpp"

#include "idl/conversions/occupancy_grid.hpp"

namespace stillmap::server {
namespace {

// A square kilometre in cells of 0.2 m, 25 MB: more is of no use to who gets it every second.
constexpr std::uint64_t max_cells = 25'000'000;

}  // namespace

TraversabilityGridProvider::TraversabilityGridProvider(const TraversabilityConfig& areas,
                                                       const std::string& map_frame,
                                                       const LatestMap& latest_map,
                                                       const TraversabilitySnapshot& traversability)
    : profile_(areas.profiles.empty() ? std::string() : areas.grid_profile),
      window_m_(areas.grid_window_m),
      map_frame_(map_frame),
      latest_map_(latest_map),
      traversability_(traversability) {}

OccupancyGrid TraversabilityGridProvider::grid() const {
  OccupancyGrid none;
  none.status = TraversabilityStatus::not_found;
  none.reason = "no grid is configured: areas.grid_profile is empty";
  if (profile_.empty()) return none;
  OccupancyGrid grid = occupancy_grid(*traversability_.view(profile_), window(), max_cells);
  if (grid.status == TraversabilityStatus::too_large) {
    grid.reason += "; areas.grid_window_m makes it a window round the robot";
  }
  return grid;
}

nav_msgs::msg::OccupancyGrid TraversabilityGridProvider::message(const OccupancyGrid& grid) const {
  return wire::to_message(grid, latest_map_.newest_pose().stamp_ns, map_frame_);
}

TraversabilityRegion TraversabilityGridProvider::window() const {
  if (window_m_ == 0.0) return whole_map_region();
  const Eigen::Vector2d robot_map = latest_map_.newest_pose().T_map_lidar.translation().head<2>();
  const Eigen::Vector2d half = Eigen::Vector2d::Constant(window_m_ / 2.0);
  return {Eigen::AlignedBox2d(robot_map - half, robot_map + half), {}};
}

}  // namespace stillmap::server
