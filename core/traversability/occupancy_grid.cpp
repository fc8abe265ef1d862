#include "core/traversability/occupancy_grid.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>
#include <sstream>

namespace stillmap {
namespace {

// Cells along a side of a block. A shape with many corners is restricted to each block once, which
// is faster than testing every cell against all corners.
constexpr std::uint32_t block_side = 32;

/// The height at which the plan view of a shape with these bounds is largest.
double level_of(const Eigen::AlignedBox3d& bounds_map) {
  const double low = bounds_map.min().z();
  const double high = bounds_map.max().z();
  // A sphere is widest at its centre.
  if (std::isfinite(low) && std::isfinite(high)) return 0.5 * (low + high);
  return std::clamp(0.0, low, high);
}

Eigen::Vector3d at_level(const Eigen::Vector2d& p_map, double level_m) {
  return {p_map.x(), p_map.y(), level_m};
}

/// Part of a range, in cells from the range's first.
struct Block {
  std::uint32_t begin_x, begin_y, end_x, end_y;
};

template <typename Visit>
void visit_block(const CellRange& range, const Block& block, const Visit& visit) {
  for (std::uint32_t y = block.begin_y; y < block.end_y; ++y) {
    for (std::uint32_t x = block.begin_x; x < block.end_x; ++x) {
      visit(static_cast<std::size_t>(y) * range.width + x,
            CellIndex{range.first.x + static_cast<std::int32_t>(x),
                      range.first.y + static_cast<std::int32_t>(y)});
    }
  }
}

Eigen::AlignedBox3d box_of(const TraversabilityView& view, const CellRange& range,
                           const Block& block, double level_m) {
  const auto corner = [&](std::uint32_t x, std::uint32_t y) {
    return at_level(view.cell_m * Eigen::Vector2d(static_cast<double>(range.first.x) + x,
                                                  static_cast<double>(range.first.y) + y),
                    level_m);
  };
  return {corner(block.begin_x, block.begin_y), corner(block.end_x, block.end_y)};
}

OccupancyGrid refused(TraversabilityStatus status, const std::string& reason) {
  OccupancyGrid grid;
  grid.status = status;
  grid.reason = reason;
  return grid;
}

std::string text_of(const Eigen::AlignedBox2d& box_map) {
  std::ostringstream text;
  text << "box (" << box_map.min().x() << ", " << box_map.min().y() << ") to (" << box_map.max().x()
       << ", " << box_map.max().y() << ")";
  return text.str();
}

std::int8_t value_of(const TraversabilityCell& cell) {
  return cell.state == CellState::unknown ? occupancy_unknown : static_cast<std::int8_t>(cell.cost);
}

/// The cells that a box touches; more than a CellRange can hold.
struct WideRange {
  CellIndex first;
  std::uint64_t width;
  std::uint64_t height;
};

WideRange range_of(const TraversabilityView& view, const Eigen::AlignedBox2d& box_map) {
  // A bound between two cells must not include another cell by rounding.
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
  text << text_of(box_map) << " has " << range.width << " x " << range.height << " cells of "
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

cv::Mat1b free_cells(const OccupancyGrid& grid) {
  cv::Mat1b free(static_cast<int>(grid.height), static_cast<int>(grid.width));
  for (int y = 0; y < free.rows; ++y) {
    for (int x = 0; x < free.cols; ++x) {
      const std::int8_t value =
          grid.at(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y));
      free(y, x) = value >= 0 && value < occupancy_inscribed ? 255 : 0;
    }
  }
  return free;
}

/// Positive if counterclockwise.
double signed_area_m2(const TraversableRing& ring) {
  double twice = 0.0;
  for (std::size_t i = 0; i < ring.size(); ++i) {
    const Eigen::Vector2d& a = ring[i];
    const Eigen::Vector2d& b = ring[(i + 1) % ring.size()];
    twice += a.x() * b.y() - b.x() * a.y();
  }
  return 0.5 * twice;
}

TraversableRing ring_of(const std::vector<cv::Point>& contour, const OccupancyGrid& grid,
                        bool is_counterclockwise) {
  TraversableRing ring;
  for (const cv::Point& cell : contour) {
    ring.push_back(grid.origin_map +
                   grid.resolution_m * Eigen::Vector2d(cell.x + 0.5, cell.y + 0.5));
  }
  if ((signed_area_m2(ring) > 0.0) != is_counterclockwise) std::reverse(ring.begin(), ring.end());
  return ring;
}

}  // namespace

TraversabilityRegion whole_map_region() {
  const Eigen::Vector2d infinite =
      Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity());
  return {Eigen::AlignedBox2d(-infinite, infinite), {}};
}

TraversabilityRegion traversability_region(const Region& region) {
  RegionShape shape(region);
  const Eigen::AlignedBox3d& bounds_map = shape.bounds_map();
  const Eigen::AlignedBox2d box_map(bounds_map.min().head<2>(), bounds_map.max().head<2>());
  if (std::holds_alternative<BoxRegion>(region)) return {box_map, {}};
  return {box_map, std::move(shape)};
}

void visit_cells(const TraversabilityView& view, const TraversabilityRegion& region,
                 const CellRange& range, const std::function<void(std::size_t, CellIndex)>& visit) {
  if (!region.shape) {
    visit_block(range, {0, 0, range.width, range.height}, visit);
    return;
  }
  const double level_m = level_of(region.shape->bounds_map());
  for (std::uint32_t y = 0; y < range.height; y += block_side) {
    for (std::uint32_t x = 0; x < range.width; x += block_side) {
      const Block block{x, y, std::min(x + block_side, range.width),
                        std::min(y + block_side, range.height)};
      const Eigen::AlignedBox3d box_map = box_of(view, range, block, level_m);
      if (!region.shape->may_intersect(box_map)) continue;
      const RegionShape near = region.shape->restricted_to(box_map);
      visit_block(range, block, [&](std::size_t i, CellIndex cell) {
        if (near.contains(at_level(view.centre_of(cell), level_m))) visit(i, cell);
      });
    }
  }
}

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
                   text_of(asked) + ": each minimum must be a number not above its maximum");
  }
  if (view.tiles.empty())
    return refused(TraversabilityStatus::not_found, TraversabilityView::nothing_known);
  const Eigen::AlignedBox2d box_map = asked.intersection(view.bounds_map());
  if (box_map.isEmpty()) {
    return refused(TraversabilityStatus::not_found,
                   text_of(asked) + " lies outside the map: " + text_of(view.bounds_map()));
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

double area_m2(const TraversablePolygon& polygon) {
  double area = std::abs(signed_area_m2(polygon.outer));
  for (const TraversableRing& hole : polygon.holes) area -= std::abs(signed_area_m2(hole));
  return area;
}

std::vector<TraversablePolygon> free_outlines(const OccupancyGrid& grid, double min_area_m2) {
  if (grid.data.empty()) return {};
  std::vector<std::vector<cv::Point>> contours;
  // For each contour: next and previous of its level, first child, parent.
  std::vector<cv::Vec4i> hierarchy;
  cv::findContours(free_cells(grid), contours, hierarchy, cv::RETR_CCOMP, cv::CHAIN_APPROX_SIMPLE);
  std::vector<TraversablePolygon> polygons;
  for (std::size_t i = 0; i < contours.size(); ++i) {
    const bool is_hole = hierarchy[i][3] >= 0;
    if (is_hole) continue;
    TraversablePolygon polygon;
    polygon.outer = ring_of(contours[i], grid, true);
    for (int hole = hierarchy[i][2]; hole >= 0;
         hole = hierarchy[static_cast<std::size_t>(hole)][0]) {
      polygon.holes.push_back(ring_of(contours[static_cast<std::size_t>(hole)], grid, false));
    }
    if (area_m2(polygon) >= min_area_m2) polygons.push_back(std::move(polygon));
  }
  std::ranges::stable_sort(polygons, std::ranges::greater{}, area_m2);
  return polygons;
}

}  // namespace stillmap
