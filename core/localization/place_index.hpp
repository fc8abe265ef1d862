#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/lidar/level_plane.hpp"
#include "core/lidar/shared_trajectory.hpp"
#include "core/localization/layered_cells.hpp"
#include "core/map/query/tile_reader.hpp"
#include "core/map/tile.hpp"
#include "core/odometry/feature_map.hpp"

namespace stillmap {

struct PlaceIndexConfig {
  LayeredCellsConfig coarse{.cell_m = 1.0, .layer_m = 2.0, .margin_m = 0.35};
  LayeredCellsConfig fine{.cell_m = 0.25, .layer_m = 1.0, .margin_m = 0.2};
  /// A lidar is looked for up to this far from where one was before [m]: in the other lanes, too.
  double corridor_m = 12.0;
  /// Distance between the places of the path that are kept [m].
  double node_spacing_m = 2.0;
};

/// A place that the path of the map leads through.
struct PathNode {
  Eigen::Vector2d position_map = Eigen::Vector2d::Zero();
  /// Ground round it: heights of the map over places from `position_map`.
  LevelPlane ground;
  /// Of the path above the ground [m].
  double body_height_m = 0.0;
};

/// What a map looks like to a lidar that may be anywhere on it: which cells are occupied by what
/// stands up, in layers of height, and where on it a lidar can be. Made from a map alone (voxels,
/// classes, trajectory), whose tiles need not be in memory. Immutable: any number of threads may
/// read it.
class PlaceIndex {
 public:
  /// Cells of a block that is searched as one: rows of `block_width`.
  static constexpr int block_width = 32;
  static constexpr int block_height = 16;
  /// A part of the plane where a lidar may be, on one storey where the path leads over itself.
  struct Block {
    /// Its lowest cell, in coarse cells.
    int first_x = 0;
    int first_y = 0;
    /// Not 0 for the cells within the corridor.
    std::vector<std::uint8_t> is_searched;
    /// The node that is nearest to its middle.
    std::uint32_t node = 0;
  };

  /// Without a trajectory a lidar may be wherever the map has ground. Throws TileChanged.
  PlaceIndex(std::shared_ptr<const MapSnapshot> map, const SharedTrajectory& trajectory,
             std::shared_ptr<TileReader> tiles, const PlaceIndexConfig& config = {});

  [[nodiscard]] const PlaceIndexConfig& config() const { return config_; }
  [[nodiscard]] const LayeredCells& coarse() const { return coarse_; }
  [[nodiscard]] const LayeredCells& fine() const { return fine_; }
  [[nodiscard]] const std::vector<PathNode>& nodes() const { return nodes_; }
  [[nodiscard]] const std::vector<Block>& blocks() const { return blocks_; }
  [[nodiscard]] bool empty() const { return blocks_.empty(); }

  /// The map's voxels within this distance, across; their means and classes. Throws what the
  /// tiles' store throws.
  [[nodiscard]] std::vector<LabelledPoint> points_near(const Eigen::Vector2d& position_map,
                                                       double radius_m) const;
  /// Whether the path leads over itself.
  [[nodiscard]] bool has_storeys() const { return has_storeys_; }
  /// Heights of the ground at a place by the nodes within this distance, the lowest first, each
  /// storey once. Where there are storeys.
  [[nodiscard]] std::vector<double> floors_near(const Eigen::Vector2d& position_map,
                                                double radius_m) const;
  /// Of the path above the ground, at the nearest node [m].
  [[nodiscard]] double body_height_m(const Eigen::Vector2d& position_map) const;
  /// Tiles that could not be read: nothing is looked for there.
  [[nodiscard]] std::size_t unread_tiles() const { return unread_tiles_; }
  /// Of the index itself.
  [[nodiscard]] std::size_t memory_bytes() const;

 private:
  /// Heights of the ground of coarse cells, by their keys.
  struct Floors {
    tsl::robin_map<std::uint64_t, float, IndexHash> lowest;
    /// Those of the storeys above it, the lowest first.
    tsl::robin_map<std::uint64_t, std::vector<float>, IndexHash> higher;

    /// What a path of this height leads over; nothing where that is too far from it.
    [[nodiscard]] std::optional<float> below(std::uint64_t cell, float path_height_m) const;
  };

  /// Fills the cells; the ground comes back.
  [[nodiscard]] Floors fill_cells();
  /// Null where the tile is damaged. Throws TileChanged.
  [[nodiscard]] std::shared_ptr<const Tile> readable(const TileTable::SharedTile& tile) const;
  void place_nodes(const SharedTrajectory& trajectory, const Floors& floors);
  void place_nodes_on_ground(const Floors& floors);
  void fit_ground(const Floors& floors, const std::vector<float>& path_heights_m);
  void place_blocks();
  /// Nodes by the storey that they are on.
  [[nodiscard]] std::vector<std::vector<std::uint32_t>> storeys_of(
      std::vector<std::uint32_t> nodes, const Eigen::Vector2d& middle_map) const;
  void place_block(Block block, const std::vector<std::uint32_t>& nodes);
  [[nodiscard]] Eigen::Vector2d middle_of(const Block& block) const;

  std::shared_ptr<const MapSnapshot> map_;
  std::shared_ptr<TileReader> tiles_;
  PlaceIndexConfig config_;
  LayeredCells coarse_;
  LayeredCells fine_;
  bool has_storeys_ = false;
  std::size_t unread_tiles_ = 0;
  std::vector<PathNode> nodes_;
  std::vector<Block> blocks_;
};

}  // namespace stillmap
