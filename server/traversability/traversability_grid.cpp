#include "server/traversability/traversability_grid.hpp"

#include <cmath>
#include <string>
#include <utility>

#include "idl/conversions/occupancy_grid.hpp"

namespace stillmap::server {
namespace {

// A square kilometre in cells of 0.2 m, 25 MB: more is of no use every second.
constexpr std::uint64_t max_cells = 25'000'000;

bool is_same_grid(const OccupancyGrid& a, const OccupancyGrid& b) {
  return a.origin_map == b.origin_map && a.resolution_m == b.resolution_m && a.width == b.width &&
         a.height == b.height && a.data == b.data;
}

}  // namespace

TraversabilityGridProvider::TraversabilityGridProvider(const TraversabilityConfig& config,
                                                       const std::string& map_frame,
                                                       const LatestMap& latest_map,
                                                       const TraversabilitySnapshot& traversability)
    : profile_(config.profiles.empty() ? std::string() : config.grid_profile),
      window_m_(config.grid_window_m),
      map_frame_(map_frame),
      latest_map_(latest_map),
      traversability_(traversability) {}

StampedGrid TraversabilityGridProvider::grid() const {
  StampedGrid none;
  none.status = TraversabilityStatus::not_found;
  none.reason = "no grid is configured: traversability.grid_profile is empty";
  if (profile_.empty()) return none;
  // Before the view: what it does not know of yet is then not missed.
  const std::int64_t newest_ns = latest_map_.newest_pose().stamp_ns;
  const std::uint64_t corrections = latest_map_.corrections();
  const TraversabilitySnapshot::Known kept = traversability_.known(profile_);
  // After a load or a reset what is kept is of the last map for a while.
  if (kept.map && kept.map->map_id != latest_map_.view()->map_id) {
    none.reason = "another map began, and has no grid yet; ask again in a moment";
    return none;
  }
  return {grid_of(*kept.view), kept.corrections == corrections ? newest_ns : kept.stamp_ns};
}

OccupancyGrid TraversabilityGridProvider::grid_of(const TraversabilityView& view) const {
  OccupancyGrid grid = occupancy_grid(view, window(), max_cells);
  if (grid.status != TraversabilityStatus::too_large) return grid;
  const double edge_m = (std::sqrt(static_cast<double>(max_cells)) - 2.0) * view.cell_m;
  OccupancyGrid part = occupancy_grid(view, square_round_robot(edge_m), max_cells);
  if (part.status == TraversabilityStatus::ok) {
    part.reason = grid.reason + "; it shows " + std::to_string(std::lround(edge_m)) +
                  " m round the robot, less with traversability.grid_window_m";
  }
  return part;
}

nav_msgs::msg::OccupancyGrid TraversabilityGridProvider::message(const StampedGrid& grid) const {
  return wire::to_message(grid, grid.stamp_ns, map_frame_);
}

TraversabilityRegion TraversabilityGridProvider::window() const {
  return window_m_ == 0.0 ? whole_map_region() : square_round_robot(window_m_);
}

TraversabilityRegion TraversabilityGridProvider::square_round_robot(double edge_m) const {
  const Eigen::Vector2d robot_map = latest_map_.newest_pose().T_map_lidar.translation().head<2>();
  const Eigen::Vector2d half = Eigen::Vector2d::Constant(edge_m / 2.0);
  return {Eigen::AlignedBox2d(robot_map - half, robot_map + half), {}};
}

TraversabilityPublisher::TraversabilityPublisher(dds::Participant& participant,
                                                 const dds::Topics& topics,
                                                 const TraversabilityGridProvider& grid_provider)
    : grid_provider_(grid_provider),
      writer_(participant, topics.traversability.dds_name, topics.traversability.writer) {}

void TraversabilityPublisher::publish() {
  StampedGrid grid = grid_provider_.grid();
  if (grid.status == TraversabilityStatus::ok && !grid.reason.empty())
    throttled_log_.warn("grid", "the published grid is a part of the area: " + grid.reason);
  if (is_same_grid(grid, published_)) return;
  published_ = std::move(grid);
  // A keep-last writer always has room.
  static_cast<void>(writer_.write(grid_provider_.message(published_)));
}

}  // namespace stillmap::server
