#include "core/traversability/occupancy_grid.hpp"

#include <cmath>
#include <limits>
#include <sstream>

namespace stillmap {
namespace {

OccupancyGrid refused(AreaStatus status, const std::string& reason) {
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

/// The cells that the region's box touches.
struct CellRange {
  CellIndex first;
  std::uint64_t width;
  std::uint64_t height;
};

CellRange range_of(const TraversabilityView& view, const Eigen::AlignedBox2d& box_map) {
  // An edge between two cells must not take in one more because of the last digit.
  constexpr double slack = 1e-6;
  const Eigen::Vector2d low = (box_map.min().array() / view.cell_m + slack).floor();
  const Eigen::Vector2d high = (box_map.max().array() / view.cell_m - slack).ceil();
  return {{static_cast<std::int32_t>(low.x()), static_cast<std::int32_t>(low.y())},
          static_cast<std::uint64_t>(std::max(1.0, high.x() - low.x())),
          static_cast<std::uint64_t>(std::max(1.0, high.y() - low.y()))};
}

void fill(OccupancyGrid& grid, const TraversabilityView& view, CellIndex first,
          const AreaRegion& region) {
  CellLookup lookup(view);
  grid.data.reserve(static_cast<std::size_t>(grid.width) * grid.height);
  for (std::uint32_t y = 0; y < grid.height; ++y) {
    for (std::uint32_t x = 0; x < grid.width; ++x) {
      const CellIndex index{first.x + static_cast<std::int32_t>(x),
                            first.y + static_cast<std::int32_t>(y)};
      const bool is_inside = !region.contains || region.contains(view.centre_of(index));
      grid.data.push_back(is_inside ? value_of(lookup.at(index).cell) : occupancy_unknown);
    }
  }
}

}  // namespace

AreaRegion everywhere() {
  const Eigen::Vector2d infinite =
      Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  return {Eigen::AlignedBox2d(-infinite, infinite), {}};
}

OccupancyGrid occupancy_grid(const TraversabilityView& view, const AreaRegion& region) {
  const Eigen::AlignedBox2d& asked = region.box_map;
  // Written so that NaN fails.
  if (!(asked.min().array() <= asked.max().array()).all()) {
    return refused(AreaStatus::invalid_request,
                   shown(asked) + ": each minimum must be a number not above its maximum");
  }
  if (view.tiles.empty()) return refused(AreaStatus::not_found, "the map is empty");
  const Eigen::AlignedBox2d box_map = asked.intersection(view.bounds_map());
  if (box_map.isEmpty()) {
    return refused(AreaStatus::not_found,
                   shown(asked) + " lies outside the map: " + shown(view.bounds_map()));
  }
  const CellRange range = range_of(view, box_map);
  if (range.width * range.height > max_grid_cells) {
    return refused(AreaStatus::too_large, shown(box_map) + " has more than " +
                                              std::to_string(max_grid_cells) +
                                              " cells; ask for a smaller box");
  }
  OccupancyGrid grid;
  grid.origin_map = view.cell_m * Eigen::Vector2d(range.first.x, range.first.y);
  grid.resolution_m = view.cell_m;
  grid.width = static_cast<std::uint32_t>(range.width);
  grid.height = static_cast<std::uint32_t>(range.height);
  grid.map_version = view.version;
  fill(grid, view, range.first, region);
  return grid;
}

}  // namespace stillmap
