#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cmath>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/map/tile.hpp"
#include "core/traversability/cell_grid.hpp"
#include "core/traversability/robot_profile.hpp"
#include "core/traversability/surface_tile.hpp"

namespace stillmap {

enum class CellState : std::uint8_t {
  /// The ground has not been observed. Not the same as lethal.
  unknown,
  free,
  lethal,
};

/// Why a cell is lethal. Where several reasons apply, the first of this list is given.
enum class BlockReason : std::uint8_t {
  none,
  /// An object on the ground.
  obstacle,
  /// An object hanging lower than the robot's height.
  low_headroom,
  step,
  slope,
  roughness,
  /// Ground of a class that is lethal for the robot.
  ground_class,
  /// Within the inscribed radius of a lethal cell (Nav2's inscribed cost).
  inscribed,
  /// Unknown ground. In path checks only: such cells are not lethal.
  unknown,
};
inline constexpr std::size_t block_reason_count = 9;

[[nodiscard]] std::string_view name(CellState state);
[[nodiscard]] std::string_view name(BlockReason reason);

/// Classification of a cell for one robot.
struct TraversabilityCell {
  CellState state = CellState::unknown;
  BlockReason reason = BlockReason::none;
  /// The ground was not measured but interpolated.
  bool inferred = false;
  /// 0 to 98 when free, 99 when inscribed, 100 when lethal in itself; 0 when unknown.
  std::uint8_t cost = 0;
  /// From the cell's centre to that of the nearest cell that is lethal in itself [m]; at most
  /// `clearance_limit_m`.
  float clearance_m = 0.0F;

  /// Whether the cell is lethal in itself and not merely inscribed.
  [[nodiscard]] bool is_lethal_itself() const {
    return state == CellState::lethal && reason != BlockReason::inscribed;
  }
  friend bool operator==(const TraversabilityCell&, const TraversabilityCell&) = default;
};

/// Classification of a map tile for one robot.
struct TraversabilityTile {
  TileId id;
  /// Map version at the tile's last change.
  std::uint64_t revision = 0;
  /// Cells along a side.
  int side = 0;
  /// Row by row from the lowest y.
  std::vector<TraversabilityCell> cells;
  std::shared_ptr<const SurfaceTile> surface;

  [[nodiscard]] const TraversabilityCell& at(int x, int y) const {
    return cells[static_cast<std::size_t>(y) * static_cast<std::size_t>(side) +
                 static_cast<std::size_t>(x)];
  }
};

/// Why no part of the robot may be over the cell; none where it may.
[[nodiscard]] BlockReason conflict_with(const TraversabilityCell& cell,
                                        const RobotProfile& profile);

/// Upper limit of `clearance_m` [m].
[[nodiscard]] double clearance_limit_m(const RobotProfile& profile);

/// The middle tile's cells, with inscribed cells and costs around lethal cells, including those of
/// the neighbouring tiles.
[[nodiscard]] std::vector<TraversabilityCell> classify_tile(
    const TileNeighbourhood<SurfaceTile>& surfaces, const RobotProfile& profile, double cell_m);

/// Index of a cell of the map: [x, x+1) * cell_m by [y, y+1) * cell_m in the map frame.
struct CellIndex {
  std::int32_t x = 0;
  std::int32_t y = 0;
  friend bool operator==(const CellIndex&, const CellIndex&) = default;
};

/// Immutable snapshot of the traversability for one robot; safe to read from any thread.
struct TraversabilityView {
  /// Why one without tiles tells nothing. Where those of the whole map are not worked out yet, a
  /// view holds what is near the region that was asked for alone.
  static constexpr const char* nothing_known =
      "no area is known yet: the map is empty, or its areas are still being worked out";

  /// Version of the map that it was computed from.
  std::uint64_t version = 0;
  std::uint64_t map_id = 0;
  double tile_size_m = 0.0;
  /// Edge of a cell: the map's voxel size [m].
  double cell_m = 0.0;
  RobotProfile profile;
  /// One for each tile of the map, sorted by id.
  std::vector<std::shared_ptr<const TraversabilityTile>> tiles;

  /// The cell that contains a position (map frame [m]); nothing if it is not finite or farther than
  /// 100 km from the origin.
  [[nodiscard]] std::optional<CellIndex> cell_of(const Eigen::Vector2d& position_map) const;
  /// Centre of a cell, map frame [m].
  [[nodiscard]] Eigen::Vector2d centre_of(CellIndex cell) const;
  /// Box around all tiles, map frame [m]; empty without tiles.
  [[nodiscard]] Eigen::AlignedBox2d bounds_map() const;
};

/// Looks up cells of a view, fastest if consecutive cells share a tile. Must not outlive the view.
class CellLookup {
 public:
  explicit CellLookup(const TraversabilityView& view);

  struct Found {
    TraversabilityCell cell;
    /// Null where there is no tile.
    const SurfaceCell* surface = nullptr;
  };
  /// Cells outside all tiles are unknown.
  [[nodiscard]] Found at(CellIndex cell);

 private:
  const TraversabilityView& view_;
  std::int32_t side_;
  std::optional<TileId> last_id_;
  const TraversabilityTile* last_ = nullptr;
};

/// Pose of a robot's reference point, with its heading counterclockwise from x.
struct PlanarPose {
  Eigen::Vector2d position_map = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;
};

/// The cells that a robot touches at a pose: those whose square overlaps its footprint.
class FootprintCells {
 public:
  /// @pre the cell of the position exists (TraversabilityView::cell_of)
  FootprintCells(const RobotProfile& profile, const PlanarPose& pose, double cell_m);

  /// Corners of the box that holds them.
  [[nodiscard]] CellIndex low() const { return low_; }
  [[nodiscard]] CellIndex high() const { return high_; }
  /// Whether a cell of this box is touched.
  [[nodiscard]] bool has(CellIndex cell) const {
    const Eigen::Vector2d offset_m =
        cell_m_ * Eigen::Vector2d(cell.x + 0.5, cell.y + 0.5) - centre_map_;
    return std::abs(offset_m.dot(ahead_)) <= half_length_m_ &&
           std::abs(offset_m.x() * ahead_.y() - offset_m.y() * ahead_.x()) <= half_width_m_;
  }

 private:
  double cell_m_;
  Eigen::Vector2d ahead_;
  Eigen::Vector2d centre_map_;
  /// Of the footprint and a cell beside it.
  double half_length_m_;
  double half_width_m_;
  CellIndex low_;
  CellIndex high_;
};

/// Calls `visit(CellIndex)` for these cells. @pre view.cell_of(pose.position_map)
void visit_footprint(const TraversabilityView& view, const PlanarPose& pose,
                     const std::function<void(CellIndex)>& visit);

/// Outcome of a query on a view.
enum class TraversabilityStatus : std::uint8_t {
  ok,
  /// `reason` names the invalid value and the valid ones.
  invalid_request,
  /// The answer or the computation would be too large; `reason` names the limit.
  too_large,
  /// The map has nothing that the query asks for.
  not_found,
};

[[nodiscard]] std::string_view name(TraversabilityStatus status);

struct NearestTraversable {
  TraversabilityStatus status = TraversabilityStatus::ok;
  std::string reason;
  /// Centre of the nearest such cell, map frame [m].
  Eigen::Vector2d position_map = Eigen::Vector2d::Zero();
  /// Height of the ground there, map frame [m].
  double height_m = 0.0;
  /// From the given position [m].
  double distance_m = 0.0;
  TraversabilityCell cell;
  std::uint64_t map_version = 0;
};

/// The free cell nearest to a position, at most `max_distance_m` away, on which the robot can stand
/// with some heading. Inferred ground counts, unknown ground does not.
[[nodiscard]] NearestTraversable nearest_traversable(const TraversabilityView& view,
                                                     const Eigen::Vector2d& position_map,
                                                     double max_distance_m = 100.0);

}  // namespace stillmap
