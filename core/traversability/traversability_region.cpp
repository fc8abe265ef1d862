#include "core/traversability/traversability_region.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace stillmap {
namespace {

// Cells along a side of a block. A shape of many corners is cut down to the few near a block once,
// instead of asked as a whole for every cell.
constexpr std::uint32_t block_side = 32;

/// A height at which a point of the box is inside whenever one at another height is.
double level_of(const Eigen::AlignedBox3d& bounds_map) {
  const double low = bounds_map.min().z();
  const double high = bounds_map.max().z();
  // The middle of a sphere is where it is widest.
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

}  // namespace stillmap
