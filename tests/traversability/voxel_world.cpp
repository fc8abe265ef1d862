#include "tests/traversability/voxel_world.hpp"

#include <cmath>

#include "core/map/voxel_grid.hpp"

namespace stillmap::test {
namespace {

int cell_at(double position_m) {
  return static_cast<int>(std::ceil(position_m / 0.2 - 0.5 - 1e-9));
}

int floor_divide(int a, int b) { return a >= 0 ? a / b : -((-a + b - 1) / b); }

/// Calls `visit(x, y)` for the cells whose centre lies in the rectangle.
template <typename Visit>
void for_cells(double x0, double y0, double x1, double y1, const Visit& visit) {
  for (int y = cell_at(y0); y < cell_at(y1); ++y) {
    for (int x = cell_at(x0); x < cell_at(x1); ++x) visit(x, y);
  }
}

}  // namespace

void VoxelWorld::put(int x, int y, double z_m, SemanticClass label) {
  const TileId tile{floor_divide(x, side_), floor_divide(y, side_)};
  Voxel voxel;
  voxel.index = {static_cast<std::uint16_t>(x - tile.x * side_),
                 static_cast<std::uint16_t>(y - tile.y * side_),
                 static_cast<std::int16_t>(std::floor(z_m / cell_m))};
  voxel.point_count = 10;
  voxel.mean_map = Eigen::Vector3d((x + 0.5) * cell_m, (y + 0.5) * cell_m, z_m).cast<float>();
  if (label != SemanticClass::unlabeled) voxel.evidence.add(label, 10.0F);
  columns_[{x, y}][voxel.index.z] = voxel;
}

void VoxelWorld::ground(double x0, double y0, double x1, double y1, SemanticClass label,
                        const Heights& height_m) {
  clear(x0, y0, x1, y1);
  for_cells(x0, y0, x1, y1, [&](int x, int y) {
    put(x, y, height_m((x + 0.5) * cell_m, (y + 0.5) * cell_m), label);
  });
}

void VoxelWorld::block(double x0, double y0, double x1, double y1, double low_m, double high_m,
                       SemanticClass label) {
  for_cells(x0, y0, x1, y1, [&](int x, int y) {
    for (double z_m = low_m; z_m < high_m - 1e-9; z_m += cell_m) put(x, y, z_m, label);
  });
}

void VoxelWorld::clear(double x0, double y0, double x1, double y1) {
  for_cells(x0, y0, x1, y1, [&](int x, int y) { columns_.erase({x, y}); });
}

MapSnapshot VoxelWorld::view() {
  ++version_;
  std::map<TileId, std::vector<Voxel>> voxels;
  for (const auto& [cell, column] : columns_) {
    for (const auto& [layer, voxel] : column) {
      voxels[{floor_divide(cell.first, side_), floor_divide(cell.second, side_)}].push_back(voxel);
    }
  }
  MapSnapshot map;
  map.version = version_;
  map.map_id = 1;
  map.tile_size_m = side_ * cell_m;
  map.voxel_size_m = cell_m;
  const VoxelGrid grid(cell_m, side_ * cell_m);
  for (auto& [id, list] : voxels) {
    std::ranges::sort(list, {}, &Voxel::index);
    Tile tile = make_tile(id, version_, std::move(list), grid);
    TileInfo& known = infos_[id];
    if (known.content_hash == tile.info.content_hash) tile.info.revision = known.revision;
    known = tile.info;
    map.tiles.set(std::make_shared<const Tile>(std::move(tile)));
  }
  return map;
}

RobotProfile square_robot() {
  RobotProfile robot;
  robot.name = "square";
  robot.length_m = robot.width_m = 1.0;
  robot.ground_clearance_m = 0.15;
  robot.height_m = 1.5;
  robot.max_step_m = 0.1;
  robot.max_slope_deg = 15.0;
  robot.max_roughness_m = 0.05;
  robot.class_cost.at(static_cast<std::size_t>(SemanticClass::road)) = 0.0;
  robot.class_cost.at(static_cast<std::size_t>(SemanticClass::parking)) = 0.2;
  robot.class_cost.at(static_cast<std::size_t>(SemanticClass::unlabeled)) = 0.3;
  return robot;
}

std::shared_ptr<const TraversabilityView> traversability_of(const MapSnapshot& map,
                                                            const RobotProfile& profile) {
  TraversabilityMap area({profile});
  (void)area.update(map);
  return area.view(profile.name);
}

CellLookup::Found look(const TraversabilityView& view, double x_m, double y_m) {
  const std::optional<CellIndex> cell = view.cell_of({x_m, y_m});
  return cell ? CellLookup(view).at(*cell) : CellLookup::Found{};
}

}  // namespace stillmap::test
