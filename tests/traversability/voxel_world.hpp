#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <vector>

#include "core/map/tile.hpp"
#include "core/traversability/robot_profile.hpp"
#include "core/traversability/traversability_map.hpp"

namespace stillmap::test {

/// A map made by hand, column by column, of voxels of 0.2 m.
class VoxelWorld {
 public:
  static constexpr double cell_m = 0.2;

  /// `side` is the number of cells along a tile.
  explicit VoxelWorld(int side = 20) : side_(side) {}

  /// Height of the ground at a place [m].
  using Heights = std::function<double(double x_m, double y_m)>;

  /// Ground of a class, and nothing else, in the cells whose centre is in [x0, x1) x [y0, y1).
  void ground(double x0, double y0, double x1, double y1, SemanticClass label,
              const Heights& height_m = flat);
  /// Voxels of a class from `low_m` to below `high_m`, in the same cells.
  void block(double x0, double y0, double x1, double y1, double low_m, double high_m,
             SemanticClass label);
  /// Takes out all voxels of these cells.
  void clear(double x0, double y0, double x1, double y1);

  /// The map as it is now. Tiles that changed since the last call have a new revision.
  [[nodiscard]] MapSnapshot view();

  static double flat(double, double) { return 0.1; }

 private:
  using Columns = std::map<std::pair<int, int>, std::map<int, Voxel>>;

  void put(int x, int y, double z_m, SemanticClass label);

  int side_;
  Columns columns_;
  std::map<TileId, TileInfo> infos_;
  std::uint64_t version_ = 0;
};

/// A robot without needs: 1 m square, road only free, steps of 0.1 m.
[[nodiscard]] RobotProfile square_robot();

/// The area of one robot on a map.
[[nodiscard]] std::shared_ptr<const TraversabilityView> traversability_of(
    const MapSnapshot& map, const RobotProfile& profile);

/// What is at a place; a cell that is not there is unknown.
[[nodiscard]] CellLookup::Found look(const TraversabilityView& view, double x_m, double y_m);

}  // namespace stillmap::test
