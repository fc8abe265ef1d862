#pragma once

#include <cstdint>
#include <memory>
#include <string_view>
#include <vector>

#include "core/map/tile.hpp"
#include "core/traversability/cell_grid.hpp"
#include "core/traversability/robot_profile.hpp"
#include "core/traversability/surface_tile.hpp"

namespace stillmap {

enum class CellState : std::uint8_t {
  /// Nobody has seen the ground here. Not the same as lethal.
  unknown,
  free,
  lethal,
};

/// Why a cell is lethal. Where several reasons hold, the first one of this list is given.
enum class BlockReason : std::uint8_t {
  none,
  /// Something stands on the ground.
  obstacle,
  /// Something hangs lower than the robot is high.
  low_headroom,
  step,
  slope,
  roughness,
  /// Ground of a class that the robot must not enter.
  ground_class,
  /// Nearer to a lethal cell than the robot's inscribed radius; the cell itself has no fault.
  inscribed,
  /// Only in answers about paths: not lethal, but unknown.
  unknown,
};
inline constexpr std::size_t block_reason_count = 9;

[[nodiscard]] std::string_view name(CellState state);
[[nodiscard]] std::string_view name(BlockReason reason);

/// A cell as one robot sees it.
struct TraversabilityCell {
  CellState state = CellState::unknown;
  BlockReason reason = BlockReason::none;
  /// The ground was not seen; it follows from its surroundings.
  bool inferred = false;
  /// 0 (wanted) to 98 when free, 99 within the inscribed radius, 100 when lethal in itself; 0 when
  /// unknown.
  std::uint8_t cost = 0;
  /// From the cell's centre to that of the nearest cell that is lethal in itself [m]; at most
  /// `clearance_limit_m`.
  float clearance_m = 0.0F;

  /// Whether the cell is lethal for what is in it, not for what is near it.
  [[nodiscard]] bool is_lethal_itself() const {
    return state == CellState::lethal && reason != BlockReason::inscribed;
  }
  friend bool operator==(const TraversabilityCell&, const TraversabilityCell&) = default;
};

/// A map tile as one robot sees it.
struct TraversabilityTile {
  TileId id;
  /// Version of the map with which the tile last changed.
  std::uint64_t revision = 0;
  /// Cells along a side.
  int side = 0;
  /// Row after row from the lowest y.
  std::vector<TraversabilityCell> cells;
  std::shared_ptr<const SurfaceTile> surface;

  [[nodiscard]] const TraversabilityCell& at(int x, int y) const {
    return cells[static_cast<std::size_t>(y) * static_cast<std::size_t>(side) +
                 static_cast<std::size_t>(x)];
  }
};

/// Farthest distance that `clearance_m` tells [m].
[[nodiscard]] double clearance_limit_m(const RobotProfile& profile);

/// What one cell is in itself, without its neighbours: its clearance is 0 when it is lethal, else
/// the limit.
[[nodiscard]] TraversabilityCell classify_cell(const SurfaceTile::View& surface,
                                               const RobotProfile& profile);

/// The cells of the middle tile with the safety margin of the robot's footprint, which also comes
/// from lethal cells of the tiles around it.
[[nodiscard]] std::vector<TraversabilityCell> classify_tile(
    const TileNeighbourhood<SurfaceTile>& surfaces, const RobotProfile& profile, double cell_m);

}  // namespace stillmap
