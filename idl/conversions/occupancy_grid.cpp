#include "idl/conversions/occupancy_grid.hpp"

#include <algorithm>
#include <cmath>

#include "idl/conversions/header.hpp"
#include "idl/conversions/pose.hpp"

namespace stillmap::wire {
namespace {

Eigen::Isometry3d origin_of(const OccupancyGrid& grid) {
  Eigen::Isometry3d origin = Eigen::Isometry3d::Identity();
  origin.translation().head<2>() = grid.origin_map;
  return origin;
}

bool is_value(std::int8_t value) { return value >= occupancy_unknown && value <= occupancy_lethal; }

}  // namespace

nav_msgs::msg::OccupancyGrid to_message(const OccupancyGrid& grid, std::int64_t stamp_ns,
                                        const std::string& map_frame) {
  nav_msgs::msg::OccupancyGrid message;
  message.header(to_header(stamp_ns, map_frame));
  message.info().map_load_time(to_stamp(stamp_ns));
  message.info().resolution(static_cast<float>(grid.resolution_m));
  message.info().width(grid.width);
  message.info().height(grid.height);
  message.info().origin(to_pose(origin_of(grid)));
  message.data().assign(grid.data.begin(), grid.data.end());
  return message;
}

std::optional<OccupancyGrid> from_message(const nav_msgs::msg::OccupancyGrid& message) {
  const auto& info = message.info();
  const auto origin = to_isometry(info.origin());
  const bool is_upright = origin && origin->rotation().isApprox(Eigen::Matrix3d::Identity(), 1e-6);
  if (!is_upright || std::uint64_t{info.width()} * info.height() != message.data().size()) {
    return std::nullopt;
  }
  OccupancyGrid grid;
  grid.origin_map = origin->translation().head<2>();
  // On the wire it is a float; 0.2 shall be 0.2 again.
  constexpr double steps_per_m = 1e6;
  grid.resolution_m = std::round(info.resolution() * steps_per_m) / steps_per_m;
  grid.width = info.width();
  grid.height = info.height();
  grid.data.assign(message.data().begin(), message.data().end());
  if (!std::ranges::all_of(grid.data, is_value)) return std::nullopt;
  return grid;
}

}  // namespace stillmap::wire
