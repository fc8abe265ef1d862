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

/// Upper limit of `clearance_m` [m].
[[nodiscard]] double clearance_limit_m(const RobotProfile& profile);

/// The middle tile's cells, with inscribed cells and costs around lethal cells, including those of
/// the neighbouring tiles.
[[nodiscard]] std::vector<TraversabilityCell> classify_tile(
    const TileNeighbourhood<SurfaceTile>& surfaces, const RobotProfile& profile, double cell_m);

}  // namespace stillmap
