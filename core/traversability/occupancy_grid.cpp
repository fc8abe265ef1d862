#include "core/traversability/occupancy_grid.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

namespace stillmap {
namespace {

OccupancyGrid refused(TraversabilityStatus status, const std::string& reason) {
  OccupancyGrid grid;
  grid.status = status;
  grid.reason = reason;
  return grid;
}

std::string shown(const Eigen::AlignedBox2d& box_map) {
  std::ostringstream text;
  text << "box (" << box_map.min().x() << ", " << box_map.min().y() << ") to (" << box_map.max().x()
       << ", " << box_map.max().y() << ")";
  return text.str();
}

std::int8_t value_of(const TraversabilityCell& cell) {
  return cell.state == CellState::unknown ? occupancy_unknown : static_cast<std::int8_t>(cell.cost);
}

/// The cells that a box touches, as many as there may be.
struct WideRange {
  CellIndex first;
  std::uint64_t width;
  std::uint64_t height;
};

WideRange range_of(const TraversabilityView& view, const Eigen::AlignedBox2d& box_map) {
  // An edge between two cells must not take in one more because of the last digit.
  constexpr double slack = 1e-6;
  const Eigen::Vector2d low = (box_map.min().array() / view.cell_m + slack).floor();
  const Eigen::Vector2d high = (box_map.max().array() / view.cell_m - slack).ceil();
  return {{static_cast<std::int32_t>(low.x()), static_cast<std::int32_t>(low.y())},
          static_cast<std::uint64_t>(std::max(1.0, high.x() - low.x())),
          static_cast<std::uint64_t>(std::max(1.0, high.y() - low.y()))};
}

std::string too_many(const Eigen::AlignedBox2d& box_map, const WideRange& range, double cell_m,
                     std::uint64_t max_cells) {
  std::ostringstream text;
  text << shown(box_map) << " has " << range.width << " x " << range.height << " cells of "
       << cell_m << " m; at most " << max_cells
       << " are given at once: ask for a smaller box, or part by part";
  return text.str();
}

void fill(OccupancyGrid& grid, const TraversabilityView& view, const TraversabilityRegion& region) {
  CellLookup lookup(view);
  grid.data.assign(static_cast<std::size_t>(grid.width) * grid.height, occupancy_unknown);
  visit_cells(view, region, range_of(grid), [&](std::size_t i, CellIndex cell) {
    grid.data[i] = value_of(lookup.at(cell).cell);
  });
}

}  // namespace

CellRange range_of(const OccupancyGrid& grid) {
  const Eigen::Vector2d first = (grid.origin_map / grid.resolution_m).array().round();
  return {{static_cast<std::int32_t>(first.x()), static_cast<std::int32_t>(first.y())},
          grid.width,
          grid.height};
}

OccupancyGrid occupancy_grid(const TraversabilityView& view, const TraversabilityRegion& region,
                             std::uint64_t max_cells) {
  const Eigen::AlignedBox2d& asked = region.box_map;
  // Written so that NaN fails.
  if (!(asked.min().array() <= asked.max().array()).all()) {
    return refused(TraversabilityStatus::invalid_request,
                   shown(asked) + ": each minimum must be a number not above its maximum");
  }
  if (view.tiles.empty()) return refused(TraversabilityStatus::not_found, "the map is empty");
  const Eigen::AlignedBox2d box_map = asked.intersection(view.bounds_map());
  if (box_map.isEmpty()) {
    return refused(TraversabilityStatus::not_found,
                   shown(asked) + " lies outside the map: " + shown(view.bounds_map()));
  }
  const WideRange range = range_of(view, box_map);
  if (range.width * range.height > max_cells) {
    return refused(TraversabilityStatus::too_large,
                   too_many(box_map, range, view.cell_m, max_cells));
  }
  OccupancyGrid grid;
  grid.origin_map = view.cell_m * Eigen::Vector2d(range.first.x, range.first.y);
  grid.resolution_m = view.cell_m;
  grid.width = static_cast<std::uint32_t>(range.width);
  grid.height = static_cast<std::uint32_t>(range.height);
  grid.map_version = view.version;
  fill(grid, view, region);
  return grid;
}

}  // namespace stillmap
