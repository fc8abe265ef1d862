#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/traversability/traversability_tile.hpp"

namespace stillmap {

/// A cell of the whole map: [x, x+1) * cell_m by [y, y+1) * cell_m in the map frame.
struct CellIndex {
  std::int32_t x = 0;
  std::int32_t y = 0;
  friend bool operator==(const CellIndex&, const CellIndex&) = default;
};

/// An immutable state of the area that one robot can drive on; safe to read from any thread.
struct TraversabilityView {
  /// Of the map that it was made from.
  std::uint64_t version = 0;
  std::uint64_t map_id = 0;
  double tile_size_m = 0.0;
  /// Edge of a cell: the map's voxel size [m].
  double cell_m = 0.0;
  RobotProfile profile;
  /// Sorted by id; a tile for every tile of the map.
  std::vector<std::shared_ptr<const TraversabilityTile>> tiles;

  /// The cell that holds a place (map frame [m]); nothing for one that is not finite or farther
  /// than 100 km from the origin.
  [[nodiscard]] std::optional<CellIndex> cell_of(const Eigen::Vector2d& position_map) const;
  /// Its centre, map frame [m].
  [[nodiscard]] Eigen::Vector2d centre_of(CellIndex cell) const;
  /// Box around all tiles, map frame [m]; empty without tiles.
  [[nodiscard]] Eigen::AlignedBox2d bounds_map() const;
};

/// Looks up cells of a view, quickest when one lies near the last; must not outlive the view.
class CellLookup {
 public:
  explicit CellLookup(const TraversabilityView& view);

  struct Found {
    TraversabilityCell cell;
    /// Null where there is no tile.
    const SurfaceCell* surface = nullptr;
  };
  /// A cell where there is no tile is unknown.
  [[nodiscard]] Found at(CellIndex cell);

 private:
  const TraversabilityView& view_;
  std::int32_t side_;
  std::optional<TileId> last_id_;
  const TraversabilityTile* last_ = nullptr;
};

/// Where a robot stands: the point that its profile's poses speak of, and its heading from x
/// towards y.
struct PlanarPose {
  Eigen::Vector2d position_map = Eigen::Vector2d::Zero();
  double heading_rad = 0.0;
};

/// Calls `visit(CellIndex)` for the cells that a robot at `pose` covers: those whose centre is in
/// its footprint made half a cell larger on every side, so that none that it touches is left out
/// but at its corners. @pre the view's cell_of(pose.position_map) is a cell.
void visit_footprint(const TraversabilityView& view, const PlanarPose& pose,
                     const std::function<void(CellIndex)>& visit);

enum class TraversabilityStatus : std::uint8_t {
  ok,
  /// The question makes no sense: `reason` names the value and what would do.
  invalid_request,
  /// The answer would be too large, or the work too much; `reason` names the limit.
  too_large,
  /// Nothing of what was asked for exists.
  not_found,
};

[[nodiscard]] std::string_view name(TraversabilityStatus status);

struct NearestTraversable {
  TraversabilityStatus status = TraversabilityStatus::ok;
  std::string reason;
  /// Centre of the nearest free cell, map frame [m].
  Eigen::Vector2d position_map = Eigen::Vector2d::Zero();
  /// Of the ground there [m].
  double height_m = 0.0;
  /// From the place asked for [m].
  double distance_m = 0.0;
  TraversabilityCell cell;
  std::uint64_t map_version = 0;
};

/// The free cell nearest to a place, at most `max_distance_m` away. Free cells keep the inscribed
/// radius from everything lethal: with some heading, the robot can stand there. Inferred ground
/// counts, unknown ground does not.
[[nodiscard]] NearestTraversable nearest_traversable(const TraversabilityView& view,
                                                     const Eigen::Vector2d& position_map,
                                                     double max_distance_m = 100.0);

}  // namespace stillmap
