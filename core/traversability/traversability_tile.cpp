#include "core/traversability/traversability_tile.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "core/traversability/cell_grid.hpp"

namespace stillmap {
namespace {

constexpr double max_free_cost = 98.0;
constexpr std::uint8_t inscribed_cost = 99;
constexpr std::uint8_t lethal_cost = 100;
/// Cost at the inscribed radius; it decreases to 0 at the circumscribed radius.
constexpr double proximity_cost = 80.0;
/// Cost of ground at the robot's limit of slope or roughness.
constexpr double effort_cost = 0.5;

/// The lowest object above the robot's obstacle height and below its top.
const float* blocking_object(std::span<const float> object_heights_m, const RobotProfile& profile) {
  const auto object =
      std::ranges::upper_bound(object_heights_m, static_cast<float>(profile.obstacle_height_m()));
  return object != object_heights_m.end() && *object < profile.height_m ? &*object : nullptr;
}

BlockReason reason_of_ground(const SurfaceCell& cell, const RobotProfile& profile) {
  if (cell.shape.step_m > profile.max_step_m) return BlockReason::step;
  if (cell.shape.slope > profile.max_slope_deg * std::numbers::pi / 180.0) {
    return BlockReason::slope;
  }
  if (cell.shape.roughness_m > profile.max_roughness_m) return BlockReason::roughness;
  if (!profile.class_cost.at(static_cast<std::size_t>(cell.ground.label))) {
    return BlockReason::ground_class;
  }
  return BlockReason::none;
}

BlockReason reason_of(const SurfaceTile::View& surface, const RobotProfile& profile) {
  if (const float* object_height_m = blocking_object(surface.object_heights_m, profile)) {
    // An object that begins in the robot's upper half hangs from above.
    return *object_height_m < 0.5 * profile.height_m ? BlockReason::obstacle
                                                     : BlockReason::low_headroom;
  }
  return surface.cell->ground.is_known() ? reason_of_ground(*surface.cell, profile)
                                         : BlockReason::none;
}

std::uint8_t free_cost(const SurfaceCell& cell, const RobotProfile& profile) {
  const double of_class =
      profile.class_cost.at(static_cast<std::size_t>(cell.ground.label)).value_or(1.0);
  const double steep = cell.shape.slope / (profile.max_slope_deg * std::numbers::pi / 180.0);
  const double rough = cell.shape.roughness_m / profile.max_roughness_m;
  // Squared, so that slight slopes cost next to nothing.
  const double effort = effort_cost * std::max(steep * steep, rough * rough);
  const bool is_inferred = cell.ground.origin == GroundOrigin::inferred;
  const double cost = std::max(of_class, effort) + (is_inferred ? profile.inferred_cost : 0.0);
  return static_cast<std::uint8_t>(std::lround(max_free_cost * std::min(cost, 1.0)));
}

TraversabilityCell make_lethal(TraversabilityCell cell, BlockReason reason, std::uint8_t cost) {
  cell.state = CellState::lethal;
  cell.reason = reason;
  cell.cost = cost;
  return cell;
}

/// Classification of a cell without regard to its neighbours. The clearance is not set.
TraversabilityCell classify_cell(const SurfaceTile::View& surface, const RobotProfile& profile) {
  TraversabilityCell cell;
  if (surface.cell == nullptr) return cell;
  cell.inferred = surface.cell->ground.origin == GroundOrigin::inferred;
  const BlockReason reason = reason_of(surface, profile);
  if (reason != BlockReason::none) return make_lethal(cell, reason, lethal_cost);
  if (surface.cell->ground.is_known()) {
    cell.state = CellState::free;
    cell.cost = free_cost(*surface.cell, profile);
  }
  return cell;
}

/// Sets clearance, inscribed state and proximity cost from the distance to the nearest lethal cell.
TraversabilityCell with_distance(TraversabilityCell cell, double distance_m,
                                 const RobotProfile& profile) {
  cell.clearance_m = static_cast<float>(std::min(distance_m, clearance_limit_m(profile)));
  if (cell.state != CellState::free) return cell;
  const double inscribed_m = profile.inscribed_radius_m();
  const double circumscribed_m = profile.circumscribed_radius_m();
  if (distance_m <= inscribed_m) return make_lethal(cell, BlockReason::inscribed, inscribed_cost);
  if (distance_m < circumscribed_m) {
    const double share = (circumscribed_m - distance_m) / (circumscribed_m - inscribed_m);
    cell.cost = std::max(cell.cost, static_cast<std::uint8_t>(std::lround(proximity_cost * share)));
  }
  return cell;
}

}  // namespace

std::string_view name(CellState state) {
  constexpr std::array<std::string_view, 3> names{"unknown", "free", "lethal"};
  return names.at(static_cast<std::size_t>(state));
}

std::string_view name(BlockReason reason) {
  constexpr std::array<std::string_view, block_reason_count> names{
      "none",      "obstacle", "low head-room", "step",   "slope",
      "roughness", "class",    "inscribed",     "unknown"};
  return names.at(static_cast<std::size_t>(reason));
}

double clearance_limit_m(const RobotProfile& profile) {
  constexpr double min_limit_m = 2.0;
  return std::max(min_limit_m, profile.circumscribed_radius_m());
}

std::vector<TraversabilityCell> classify_tile(const TileNeighbourhood<SurfaceTile>& surfaces,
                                              const RobotProfile& profile, double cell_m) {
  const int margin =
      std::min(surfaces.side, static_cast<int>(std::ceil(clearance_limit_m(profile) / cell_m)));
  const auto window = surfaces.window<SurfaceTile::View>(margin, {});
  CellGrid<TraversabilityCell> classified(window.width(), window.height());
  CellGrid<std::uint8_t> lethal(window.width(), window.height());
  for_each_cell(window, [&](int x, int y) {
    classified(x, y) = classify_cell(window(x, y), profile);
    lethal(x, y) = classified(x, y).state == CellState::lethal ? 1 : 0;
  });
  const CellGrid<float> distances =
      distances_to_marked(lethal, clearance_limit_m(profile) / cell_m + 1.0);
  std::vector<TraversabilityCell> cells;
  for (int y = margin; y < margin + surfaces.side; ++y) {
    for (int x = margin; x < margin + surfaces.side; ++x) {
      cells.push_back(with_distance(classified(x, y), cell_m * distances(x, y), profile));
    }
  }
  return cells;
}

}  // namespace stillmap
