#include "tests/planning/grid_optimum.hpp"

#include <array>
#include <cmath>
#include <map>
#include <queue>
#include <utility>

namespace stillmap::test {
namespace {

using Cell = std::pair<int, int>;
constexpr std::array<Cell, 16> steps{{{1, 0},
                                      {-1, 0},
                                      {0, 1},
                                      {0, -1},
                                      {1, 1},
                                      {1, -1},
                                      {-1, 1},
                                      {-1, -1},
                                      {2, 1},
                                      {2, -1},
                                      {-2, 1},
                                      {-2, -1},
                                      {1, 2},
                                      {1, -2},
                                      {-1, 2},
                                      {-1, -2}}};

bool has_room(const TraversabilityView& view, const Cell& at) {
  CellLookup lookup(view);
  // From cell to cell the robot moves up to 2.3 cells: kept off by that much.
  const double room_m = view.profile.circumscribed_radius_m() + 1.5 * view.cell_m;
  const int reach = static_cast<int>(std::ceil(room_m / view.cell_m));
  for (int y = -reach; y <= reach; ++y) {
    for (int x = -reach; x <= reach; ++x) {
      if (std::hypot(x, y) * view.cell_m > room_m) continue;
      const TraversabilityCell cell = lookup.at({at.first + x, at.second + y}).cell;
      if (cell.state == CellState::unknown || cell.is_lethal_itself()) return false;
    }
  }
  return true;
}

Cell cell_at(const TraversabilityView& view, const Eigen::Vector2d& position_map) {
  const CellIndex cell = view.cell_of(position_map).value();
  return {cell.x, cell.y};
}

}  // namespace

std::optional<double> shortest_path_m(const TraversabilityView& view,
                                      const Eigen::Vector2d& from_map,
                                      const Eigen::Vector2d& to_map) {
  const Cell goal = cell_at(view, to_map);
  std::map<Cell, double> done;
  std::priority_queue<std::pair<double, Cell>> open;
  open.emplace(0.0, cell_at(view, from_map));
  while (!open.empty()) {
    const auto [negative_m, at] = open.top();
    open.pop();
    if (done.contains(at) || !has_room(view, at)) continue;
    done[at] = -negative_m;
    if (at == goal) return -negative_m;
    for (const auto& [x, y] : steps) {
      open.emplace(negative_m - view.cell_m * std::hypot(x, y), Cell{at.first + x, at.second + y});
    }
  }
  return std::nullopt;
}

}  // namespace stillmap::test
