#include "core/map/tools/top_view.hpp"

#include <cmath>
#include <stdexcept>
#include <string>

namespace stillmap {
namespace {

/// Column and row from the map's origin, y upwards.
using PlanCell = Eigen::Matrix<std::int64_t, 2, 1>;

PlanCell plan_cell(const QueryVoxel& voxel, double cell_size_m) {
  const Eigen::Vector2d at = voxel.position_map.head<2>().cast<double>() / cell_size_m;
  return {static_cast<std::int64_t>(std::floor(at.x())),
          static_cast<std::int64_t>(std::floor(at.y()))};
}

TopView empty_raster(const PlanCell& low, const PlanCell& high, double cell_size_m) {
  const PlanCell size = high - low + PlanCell::Ones();
  if (size.maxCoeff() > TopView::max_cells || size.prod() > TopView::max_cells) {
    throw std::invalid_argument("a raster of " + std::to_string(size.x()) + " by " +
                                std::to_string(size.y()) +
                                " cells is too large; name a region, or a coarser resolution");
  }
  TopView top;
  top.columns = static_cast<int>(size.x());
  top.rows = static_cast<int>(size.y());
  top.corner_map = {static_cast<double>(low.x()) * cell_size_m,
                    static_cast<double>(high.y() + 1) * cell_size_m};
  top.cell_size_m = cell_size_m;
  top.label.assign(static_cast<std::size_t>(size.prod()), TopView::nothing);
  top.height_m.assign(static_cast<std::size_t>(size.prod()), TopView::no_height);
  return top;
}

}  // namespace

TopView rasterize_top_view(std::span<const QueryVoxel> voxels, double cell_size_m) {
  if (voxels.empty()) throw std::invalid_argument("there are no voxels to make a raster of");
  PlanCell low = plan_cell(voxels.front(), cell_size_m);
  PlanCell high = low;
  for (const QueryVoxel& voxel : voxels) {
    low = low.cwiseMin(plan_cell(voxel, cell_size_m));
    high = high.cwiseMax(plan_cell(voxel, cell_size_m));
  }
  TopView top = empty_raster(low, high, cell_size_m);
  for (const QueryVoxel& voxel : voxels) {
    const PlanCell cell = plan_cell(voxel, cell_size_m);
    const auto at =
        static_cast<std::size_t>((high.y() - cell.y()) * top.columns + (cell.x() - low.x()));
    float& height_m = top.height_m.at(at);
    if (height_m != TopView::no_height && height_m >= voxel.position_map.z()) continue;
    height_m = voxel.position_map.z();
    top.label[at] = static_cast<std::uint8_t>(voxel.label);
  }
  return top;
}

}  // namespace stillmap
