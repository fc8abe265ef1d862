#include "core/planning/coarse_route.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <queue>

#include "core/planning/planning_stop.hpp"

namespace stillmap {
namespace {

constexpr double min_step_m = 0.4;
constexpr float blocked = std::numeric_limits<float>::infinity();

struct Step {
  int x = 0;
  int y = 0;
  double cells = 1.0;
};
constexpr double diagonal = std::numbers::sqrt2;
constexpr std::array<Step, 8> steps{
    Step{1, 0, 1.0},      Step{-1, 0, 1.0},      Step{0, 1, 1.0},       Step{0, -1, 1.0},
    Step{1, 1, diagonal}, Step{1, -1, diagonal}, Step{-1, 1, diagonal}, Step{-1, -1, diagonal}};

/// A* over squares of cells. A square has the cost of its cheapest cell, so that no gap is closed.
class Squares {
 public:
  Squares(const PlanningGrid& grid, int cells, const std::function<bool()>& should_stop)
      : grid_(grid),
        cells_(cells),
        should_stop_(should_stop),
        factors_((grid.width() + cells - 1) / cells, (grid.height() + cells - 1) / cells, blocked),
        costs_(factors_.width(), factors_.height(), blocked),
        from_(factors_.width(), factors_.height(), std::int8_t{-1}) {
    for (int y = 0; y < grid.height(); ++y) {
      poll();
      for (int x = 0; x < grid.width(); ++x) {
        if (!grid.may_stand_in({x, y})) continue;
        float& factor = factors_(x / cells_, y / cells_);
        factor = std::min(factor, static_cast<float>(grid.cost_factor({x, y})));
      }
    }
  }

  /// Cost from the start to a square that the search has reached [squares].
  [[nodiscard]] double cost_to(CellIndex square) const { return costs_(square.x, square.y); }

  [[nodiscard]] CellIndex square_of(const Eigen::Vector2d& position_map) const {
    const CellIndex cell = grid_.cell_of(position_map);
    return {cell.x / cells_, cell.y / cells_};
  }

  /// Returns whether the goal was reached.
  bool search(CellIndex start, CellIndex goal) {
    if (factor(start) == blocked || factor(goal) == blocked) return false;
    costs_(start.x, start.y) = 0.0F;
    open_.push({estimate(start, goal), 0.0F, start});
    constexpr std::size_t squares_per_poll = 4096;
    for (std::size_t i = 0; !open_.empty(); ++i) {
      if (i % squares_per_poll == 0) poll();
      const Entry entry = open_.top();
      open_.pop();
      if (entry.square == goal) return true;
      if (entry.cost <= costs_(entry.square.x, entry.square.y)) expand(entry, goal);
    }
    return false;
  }

  /// Centres of the squares on the route. @pre search() returned true
  [[nodiscard]] std::vector<Eigen::Vector2d> route(CellIndex start, CellIndex goal) const {
    std::vector<Eigen::Vector2d> points_map;
    for (CellIndex square = goal; square != start;) {
      points_map.push_back(centre_of(square));
      const Step& step = steps.at(static_cast<std::size_t>(from_(square.x, square.y)));
      square = {square.x - step.x, square.y - step.y};
    }
    std::ranges::reverse(points_map);
    return points_map;
  }

 private:
  void poll() const { stop_in("the coarse route was searched", should_stop_); }

  struct Entry {
    float total = 0.0F;
    float cost = 0.0F;
    CellIndex square;
    bool operator<(const Entry& other) const { return total > other.total; }
  };

  [[nodiscard]] float factor(CellIndex square) const { return factors_(square.x, square.y); }
  [[nodiscard]] static float estimate(CellIndex a, CellIndex b) {
    return static_cast<float>(std::hypot(a.x - b.x, a.y - b.y));
  }
  [[nodiscard]] Eigen::Vector2d centre_of(CellIndex square) const {
    const Eigen::Vector2d corner_map = grid_.centre_of({square.x * cells_, square.y * cells_});
    return corner_map + Eigen::Vector2d::Constant(0.5 * (cells_ - 1) * grid_.cell_m());
  }

  void expand(const Entry& entry, CellIndex goal) {
    for (std::size_t i = 0; i < steps.size(); ++i) {
      const CellIndex next{entry.square.x + steps.at(i).x, entry.square.y + steps.at(i).y};
      if (!factors_.contains(next.x, next.y) || factor(next) == blocked) continue;
      const float mean = 0.5F * (factor(entry.square) + factor(next));
      const float cost = entry.cost + static_cast<float>(steps.at(i).cells) * mean;
      if (cost >= costs_(next.x, next.y)) continue;
      costs_(next.x, next.y) = cost;
      from_(next.x, next.y) = static_cast<std::int8_t>(i);
      open_.push({cost + estimate(next, goal), cost, next});
    }
  }

  const PlanningGrid& grid_;
  int cells_;
  const std::function<bool()>& should_stop_;
  CellGrid<float> factors_;
  CellGrid<float> costs_;
  CellGrid<std::int8_t> from_;
  std::priority_queue<Entry> open_;
};

constexpr double pi = std::numbers::pi;

/// The route with headings averaged over some metres: its steps have eight directions only.
std::vector<PlanarPose> with_headings(const CoarseRoute& route) {
  constexpr double smoothing_m = 2.5;
  const auto reach = static_cast<std::size_t>(std::ceil(smoothing_m / route.step_m));
  std::vector<PlanarPose> poses;
  for (std::size_t i = 0; i < route.points_map.size(); ++i) {
    const Eigen::Vector2d& behind = route.points_map[i - std::min(i, reach)];
    const Eigen::Vector2d& ahead =
        route.points_map[std::min(i + reach, route.points_map.size() - 1)];
    const Eigen::Vector2d along = ahead - behind;
    poses.push_back({route.points_map[i], std::atan2(along.y(), along.x())});
  }
  return poses;
}

}  // namespace

std::optional<CoarseRoute> find_coarse_route(const PlanningGrid& grid,
                                             const Eigen::Vector2d& start_map,
                                             const Eigen::Vector2d& goal_map,
                                             const std::function<bool()>& should_stop) {
  const int cells = std::max(2, static_cast<int>(std::ceil(min_step_m / grid.cell_m() - 1e-9)));
  Squares squares(grid, cells, should_stop);
  const CellIndex start = squares.square_of(start_map);
  const CellIndex goal = squares.square_of(goal_map);
  if (!squares.search(start, goal)) return std::nullopt;
  CoarseRoute route;
  route.step_m = cells * grid.cell_m();
  route.cost = squares.cost_to(goal) * route.step_m;
  route.points_map = squares.route(start, goal);
  route.points_map.insert(route.points_map.begin(), start_map);
  route.points_map.push_back(goal_map);
  for (std::size_t i = 1; i < route.points_map.size(); ++i) {
    route.length_m += (route.points_map[i] - route.points_map[i - 1]).norm();
  }
  return route;
}

PoseSampler::PoseSampler(const PlanningGrid& grid, const CoarseRoute& route, bool is_guided,
                         std::uint32_t seed)
    : grid_(grid), route_(with_headings(route)), is_guided_(is_guided), random_(seed) {}

PlanarPose PoseSampler::draw() {
  constexpr double beside_route = 0.7;
  constexpr double near_an_end = 0.15;
  const double kind = uniform(0.0, 1.0);
  if (!is_guided_ || kind >= beside_route + near_an_end) return draw_anywhere();
  return kind < beside_route ? draw_beside_route() : draw_near_an_end();
}

PlanarPose PoseSampler::draw_beside_route() {
  // Poses on the route connect smoothly; those beside it pass obstacles that it grazes.
  constexpr double max_deviation_m = 2.0;
  constexpr double max_turn_rad = 0.5;
  const auto i = static_cast<std::size_t>(uniform(0.0, static_cast<double>(route_.size())));
  const double spread = uniform(0.0, 1.0);
  PlanarPose pose = route_[std::min(i, route_.size() - 1)];
  const double deviation_m = spread * spread * max_deviation_m;
  pose.position_map += Eigen::Vector2d(normal(deviation_m), normal(deviation_m));
  pose.heading_rad += normal(spread * max_turn_rad);
  return pose;
}

PlanarPose PoseSampler::draw_near_an_end() {
  constexpr double deviation_m = 6.0;
  const PlanarPose& end = uniform(0.0, 1.0) < 0.5 ? route_.front() : route_.back();
  return {end.position_map + Eigen::Vector2d(normal(deviation_m), normal(deviation_m)),
          uniform(-pi, pi)};
}

PlanarPose PoseSampler::draw_anywhere() {
  // Most of a map is not free. An occasional colliding sample does no harm.
  constexpr int max_tries = 200;
  const Eigen::AlignedBox2d& box_map = grid_.bounds_map();
  PlanarPose pose;
  for (int i = 0; i < max_tries; ++i) {
    pose.position_map = {uniform(box_map.min().x(), box_map.max().x()),
                         uniform(box_map.min().y(), box_map.max().y())};
    if (grid_.may_stand_in(grid_.cell_of(pose.position_map))) break;
  }
  pose.heading_rad = uniform(-pi, pi);
  return pose;
}

double PoseSampler::uniform(double low, double high) {
  const double share = static_cast<double>(random_() >> 11U) * 0x1.0p-53;
  return low + share * (high - low);
}

double PoseSampler::normal(double deviation) {
  // Box and Muller.
  const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform(0.0, 1.0)));
  return deviation * radius * std::cos(2.0 * pi * uniform(0.0, 1.0));
}

}  // namespace stillmap
