#include "core/traversability/traversability_view.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <sstream>

#include "core/map/voxel_grid.hpp"

namespace stillmap {
namespace {

constexpr double max_free_cost = 98.0;
constexpr std::uint8_t inscribed_cost = 99;
constexpr std::uint8_t lethal_cost = 100;
/// Cost at the inscribed radius; it decreases to 0 at the circumscribed radius.
constexpr double proximity_cost = 80.0;
/// Cost of ground at the robot's limit of slope or roughness.
constexpr double effort_cost = 0.5;

/// Height above the ground from which on an object may hang that was seen at the mean height of a
/// voxel: its points reach half a cell farther down at most, and not out of the voxel.
double lower_edge_m(double object_height_m, const GroundCell& ground, double cell_m) {
  const double mean_map_m = ground.height_m + object_height_m;
  const double voxel_map_m = cell_m * std::floor(mean_map_m / cell_m);
  return std::max(mean_map_m - 0.5 * cell_m, voxel_map_m) - ground.height_m;
}

/// The lowest object above the robot's obstacle height, if it reaches below its top.
const float* blocking_object(const SurfaceTile::View& surface, const RobotProfile& profile,
                             double cell_m) {
  const auto object = std::ranges::upper_bound(surface.object_heights_m,
                                               static_cast<float>(profile.obstacle_height_m()));
  if (object == surface.object_heights_m.end()) return nullptr;
  const bool is_below_top = lower_edge_m(*object, surface.cell->ground, cell_m) < profile.height_m;
  return is_below_top ? &*object : nullptr;
}

BlockReason reason_of_ground(const SurfaceCell& cell, const RobotProfile& profile) {
  if (cell.shape.step_m > profile.max_step_m) return BlockReason::step;
  // Others do not get into what is unknown behind an edge.
  if (profile.unknown == UnknownGround::allowed && cell.shape.hidden_drop_m > profile.max_step_m)
    return BlockReason::step;
  if (cell.shape.slope > profile.max_slope_deg * std::numbers::pi / 180.0) {
    return BlockReason::slope;
  }
  if (cell.shape.roughness_m > profile.max_roughness_m) return BlockReason::roughness;
  if (!profile.class_cost.at(static_cast<std::size_t>(cell.ground.label))) {
    return BlockReason::ground_class;
  }
  return BlockReason::none;
}

BlockReason reason_of(const SurfaceTile::View& surface, const RobotProfile& profile,
                      double cell_m) {
  if (const float* object_height_m = blocking_object(surface, profile, cell_m)) {
    // An object that begins in the robot's upper half hangs from above.
    return *object_height_m < 0.5 * profile.height_m ? BlockReason::obstacle
                                                     : BlockReason::low_headroom;
  }
  const SurfaceCell& cell = *surface.cell;
  if (cell.ground.is_known()) return reason_of_ground(cell, profile);
  // Of a pit nothing is known but that no robot drives over it.
  return cell.shape.step_m > profile.max_step_m ? BlockReason::step : BlockReason::none;
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
TraversabilityCell classify_cell(const SurfaceTile::View& surface, const RobotProfile& profile,
                                 double cell_m) {
  TraversabilityCell cell;
  if (surface.cell == nullptr) return cell;
  cell.inferred = surface.cell->ground.origin == GroundOrigin::inferred;
  const BlockReason reason = reason_of(surface, profile, cell_m);
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

std::int32_t floor_divide(std::int32_t a, std::int32_t b) {
  return a >= 0 ? a / b : -((-a + b - 1) / b);
}

const TraversabilityTile* find_tile(const TraversabilityView& view, TileId id) {
  const auto tile = std::ranges::lower_bound(view.tiles, id, {},
                                             [](const auto& candidate) { return candidate->id; });
  return tile != view.tiles.end() && (*tile)->id == id ? tile->get() : nullptr;
}

NearestTraversable refused(TraversabilityStatus status, const std::string& reason) {
  NearestTraversable answer;
  answer.status = status;
  answer.reason = reason;
  return answer;
}

/// From a position to the nearest point of a tile [m].
double distance_to(const TraversabilityView& view, const TraversabilityTile& tile,
                   const Eigen::Vector2d& position_map) {
  const Eigen::Vector2d low = view.tile_size_m * Eigen::Vector2d(tile.id.x, tile.id.y);
  const Eigen::AlignedBox2d box(low, low + Eigen::Vector2d::Constant(view.tile_size_m));
  return box.exteriorDistance(position_map);
}

/// A free cell, and its distance from the position that is asked for.
struct Candidate {
  double distance_m = 0.0;
  CellIndex cell;
};

/// Free cells of a tile that are nearer than `below_m`, the nearest first.
std::vector<Candidate> candidates_in(const TraversabilityView& view, const TraversabilityTile& tile,
                                     const Eigen::Vector2d& position_map, double below_m) {
  // Nearer to what is lethal, the robot touches it whatever its heading.
  const double touching_m = view.profile.inscribed_radius_m() + 0.5 * view.cell_m;
  std::vector<Candidate> candidates;
  for (int y = 0; y < tile.side; ++y) {
    for (int x = 0; x < tile.side; ++x) {
      const TraversabilityCell& cell = tile.at(x, y);
      if (cell.state != CellState::free || cell.clearance_m <= touching_m) continue;
      const CellIndex index{tile.id.x * tile.side + x, tile.id.y * tile.side + y};
      const double distance_m = (view.centre_of(index) - position_map).norm();
      if (distance_m < below_m) candidates.push_back({distance_m, index});
    }
  }
  std::ranges::sort(candidates, {}, &Candidate::distance_m);
  return candidates;
}

/// Whether a robot can stand at a pose.
bool can_stand_at(const TraversabilityView& view, CellLookup& lookup, const PlanarPose& pose) {
  const FootprintCells cells(view.profile, pose, view.cell_m);
  for (std::int32_t y = cells.low().y; y <= cells.high().y; ++y) {
    for (std::int32_t x = cells.low().x; x <= cells.high().x; ++x) {
      if (!cells.has({x, y})) continue;
      if (conflict_with(lookup.at({x, y}).cell, view.profile) != BlockReason::none) return false;
    }
  }
  return true;
}

/// Whether a robot can stand there with some heading.
bool can_stand(const TraversabilityView& view, CellLookup& lookup,
               const Eigen::Vector2d& position_map) {
  constexpr int headings = 16;
  for (int i = 0; i < headings; ++i) {
    const double heading_rad = i * 2.0 * std::numbers::pi / headings;
    if (can_stand_at(view, lookup, {position_map, heading_rad})) return true;
  }
  return false;
}

/// Free cells at which a search for a place to stand ends: some tenths of a second.
constexpr std::size_t max_tried = 20'000;

/// What came of a search for a place to stand.
struct StandingSearch {
  std::optional<Candidate> nearest;
  /// It ended at `max_tried` cells.
  bool is_cut_short = false;
};

StandingSearch search_nearest(const TraversabilityView& view, CellLookup& lookup,
                              const Eigen::Vector2d& position_map, double max_distance_m) {
  // Tiles by their distance: none behind a place that was found has a nearer one.
  std::vector<std::pair<double, const TraversabilityTile*>> tiles;
  for (const auto& tile : view.tiles)
    tiles.emplace_back(distance_to(view, *tile, position_map), tile.get());
  std::ranges::sort(tiles, {}, &std::pair<double, const TraversabilityTile*>::first);
  StandingSearch search;
  std::size_t tried = 0;
  double below_m = std::nextafter(max_distance_m, HUGE_VAL);
  for (const auto& [tile_m, tile] : tiles) {
    if (tile_m >= below_m || tried >= max_tried) break;
    for (const Candidate& candidate : candidates_in(view, *tile, position_map, below_m)) {
      if (tried >= max_tried) break;
      ++tried;
      if (!can_stand(view, lookup, view.centre_of(candidate.cell))) continue;
      search.nearest = candidate;
      below_m = candidate.distance_m;
      break;
    }
  }
  search.is_cut_short = tried >= max_tried;
  return search;
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

BlockReason conflict_with(const TraversabilityCell& cell, const RobotProfile& profile) {
  if (cell.is_lethal_itself()) return cell.reason;
  const bool is_closed =
      cell.state == CellState::unknown && profile.unknown == UnknownGround::blocked;
  return is_closed ? BlockReason::unknown : BlockReason::none;
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
    classified(x, y) = classify_cell(window(x, y), profile, cell_m);
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

std::optional<CellIndex> TraversabilityView::cell_of(const Eigen::Vector2d& position_map) const {
  // Per coordinate: the maximum of NaN and a number may be the number.
  const bool is_near = (position_map.array().abs() <= VoxelGrid::max_coordinate_m).all();
  if (!is_near || !(cell_m > 0.0)) {
    return std::nullopt;
  }
  const Eigen::Vector2d cell = (position_map / cell_m).array().floor();
  return CellIndex{static_cast<std::int32_t>(cell.x()), static_cast<std::int32_t>(cell.y())};
}

Eigen::Vector2d TraversabilityView::centre_of(CellIndex cell) const {
  return cell_m * Eigen::Vector2d(cell.x + 0.5, cell.y + 0.5);
}

Eigen::AlignedBox2d TraversabilityView::bounds_map() const {
  Eigen::AlignedBox2d box;
  for (const auto& tile : tiles) {
    const Eigen::Vector2d corner = tile_size_m * Eigen::Vector2d(tile->id.x, tile->id.y);
    box.extend(corner);
    box.extend(corner + Eigen::Vector2d::Constant(tile_size_m));
  }
  return box;
}

CellLookup::CellLookup(const TraversabilityView& view)
    : view_(view), side_(view.tiles.empty() ? 1 : view.tiles.front()->side) {}

CellLookup::Found CellLookup::at(CellIndex cell) {
  const TileId id{floor_divide(cell.x, side_), floor_divide(cell.y, side_)};
  if (id != last_id_) {
    last_ = find_tile(view_, id);
    last_id_ = id;
  }
  if (last_ == nullptr) return {};
  const int x = cell.x - id.x * side_;
  const int y = cell.y - id.y * side_;
  return {last_->at(x, y), last_->surface->at(x, y).cell};
}

FootprintCells::FootprintCells(const RobotProfile& profile, const PlanarPose& pose, double cell_m)
    : cell_m_(cell_m),
      ahead_(std::cos(pose.heading_rad), std::sin(pose.heading_rad)),
      centre_map_(pose.position_map + profile.centre_ahead_m * ahead_) {
  // A square and a rectangle overlap if their projections on the sides of both do: here on those of
  // the squares, and with half of a square's projection on those of the footprint.
  const Eigen::Vector2d across = ahead_.cwiseAbs();
  const Eigen::Vector2d reach_m =
      0.5 * (profile.length_m * across + profile.width_m * across.reverse());
  const double half_square_m = 0.5 * cell_m * across.sum();
  half_length_m_ = 0.5 * profile.length_m + half_square_m;
  half_width_m_ = 0.5 * profile.width_m + half_square_m;
  // What ends on a cell's border touches both sides of it.
  const Eigen::Vector2d low = ((centre_map_ - reach_m) / cell_m).array().ceil() - 1.0;
  const Eigen::Vector2d high = ((centre_map_ + reach_m) / cell_m).array().floor();
  low_ = {static_cast<std::int32_t>(low.x()), static_cast<std::int32_t>(low.y())};
  high_ = {static_cast<std::int32_t>(high.x()), static_cast<std::int32_t>(high.y())};
}

void visit_footprint(const TraversabilityView& view, const PlanarPose& pose,
                     const std::function<void(CellIndex)>& visit) {
  const FootprintCells cells(view.profile, pose, view.cell_m);
  for (std::int32_t y = cells.low().y; y <= cells.high().y; ++y) {
    for (std::int32_t x = cells.low().x; x <= cells.high().x; ++x) {
      if (cells.has({x, y})) visit({x, y});
    }
  }
}

std::string_view name(TraversabilityStatus status) {
  constexpr std::array<std::string_view, 4> names{"ok", "invalid request", "too large",
                                                  "not found"};
  return names.at(static_cast<std::size_t>(status));
}

NearestTraversable nearest_traversable(const TraversabilityView& view,
                                       const Eigen::Vector2d& position_map, double max_distance_m) {
  if (view.tiles.empty())
    return refused(TraversabilityStatus::not_found, TraversabilityView::nothing_known);
  std::ostringstream place;
  place << "(" << position_map.x() << ", " << position_map.y() << ")";
  std::ostringstream text;
  if (!view.cell_of(position_map)) {
    text << "position " << place.str() << "; must be finite and within 100 km of the map's origin";
    return refused(TraversabilityStatus::invalid_request, text.str());
  }
  if (!(max_distance_m > 0.0)) {
    text << "max_distance_m = " << max_distance_m << "; must be above 0";
    return refused(TraversabilityStatus::invalid_request, text.str());
  }
  CellLookup lookup(view);
  const StandingSearch search = search_nearest(view, lookup, position_map, max_distance_m);
  if (!search.nearest) {
    if (search.is_cut_short)
      text << "none of the " << max_tried << " free cells nearest to " << place.str()
           << " has room for '" << view.profile.name << "'";
    else
      text << "no place for '" << view.profile.name << "' within " << max_distance_m << " m of "
           << place.str();
    return refused(TraversabilityStatus::not_found, text.str());
  }
  const CellLookup::Found found = lookup.at(search.nearest->cell);
  return {.reason = {},
          .position_map = view.centre_of(search.nearest->cell),
          .height_m = found.surface->ground.height_m,
          .distance_m = search.nearest->distance_m,
          .cell = found.cell,
          .map_version = view.version};
}

}  // namespace stillmap
