#include "core/planning/path_planner.hpp"

#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "core/planning/coarse_route.hpp"
#include "core/planning/path_search.hpp"
#include "core/planning/path_smoother.hpp"
#include "core/planning/planning_stop.hpp"

namespace stillmap {
namespace {

constexpr double pi = std::numbers::pi;

PathPlan failed(const TraversabilityView& view, PlanStatus status, const std::string& reason) {
  PathPlan plan;
  plan.status = status;
  plan.reason = reason;
  plan.map_version = view.version;
  return plan;
}

std::string text_of(const Eigen::Vector2d& position_map) {
  std::ostringstream text;
  text << "(" << position_map.x() << ", " << position_map.y() << ")";
  return text.str();
}

std::string fault_of(const TraversabilityView& view, const Goal& goal) {
  std::ostringstream text;
  if (!view.cell_of(goal.position_map)) {
    text << "position " << text_of(goal.position_map)
         << "; must be finite and within 100 km of the map's origin";
  } else if (goal.heading_rad && !(std::abs(*goal.heading_rad) <= 1e6)) {
    text << "heading " << *goal.heading_rad << "; must be finite [rad]";
  }
  return text.str();
}

/// The free poses at a start or goal: at its heading, or at any of several.
struct FreePoses {
  std::vector<PlanarPose> poses;
  /// At the first heading that is not free.
  std::optional<PathConflict> conflict;
};

FreePoses free_poses_at(const TraversabilityView& view, const Goal& goal) {
  constexpr int any_headings = 16;
  const int headings = goal.heading_rad ? 1 : any_headings;
  FreePoses free;
  for (int i = 0; i < headings; ++i) {
    const PlanarPose pose{goal.position_map,
                          goal.heading_rad.value_or(2.0 * pi * i / any_headings)};
    const PathCheck check = check_path(view, std::span(&pose, 1));
    if (check.is_free) free.poses.push_back(pose);
    if (!free.conflict) free.conflict = check.conflict;
  }
  return free;
}

PathPlan blocked(const TraversabilityView& view, PlanStatus status, const Goal& goal,
                 const FreePoses& free) {
  PathPlan plan = failed(view, status, "");
  std::ostringstream text;
  text << "'" << view.profile.name << "' cannot stand at " << text_of(goal.position_map);
  if (free.conflict) {
    plan.conflict = free.conflict;
    text << ": " << name(free.conflict->reason) << " at "
         << text_of(free.conflict->cell_centre_map);
  }
  const NearestTraversable nearby = nearest_traversable(view, goal.position_map);
  if (nearby.status == TraversabilityStatus::ok) {
    plan.nearby = nearby;
    text << "; the nearest free place is " << text_of(nearby.position_map) << ", "
         << std::round(10.0 * nearby.distance_m) / 10.0 << " m away";
  }
  plan.reason = text.str();
  return plan;
}

/// The map, extended to start and goal, which may lie outside it on unknown ground; of a map with
/// more cells than can be searched, as much round start and goal as can be. Nothing where these
/// alone are too far apart.
std::optional<Eigen::AlignedBox2d> search_box(const TraversabilityView& view, const Goal& from,
                                              const Goal& to) {
  const auto fits = [&view](const Eigen::AlignedBox2d& box) {
    return PlanningGrid::cells_for(box, view.cell_m) <= PlanningGrid::max_cells;
  };
  Eigen::AlignedBox2d ends(from.position_map);
  ends.extend(to.position_map);
  const Eigen::AlignedBox2d map = view.bounds_map().merged(ends);
  if (fits(map)) return map;
  if (!fits(ends)) return std::nullopt;
  const auto within = [&](double margin_m) {
    const Eigen::Vector2d margin = Eigen::Vector2d::Constant(margin_m);
    return map.intersection(Eigen::AlignedBox2d(ends.min() - margin, ends.max() + margin));
  };
  double fitting_m = 0.0;
  double too_wide_m = map.sizes().maxCoeff();
  while (too_wide_m - fitting_m > 1.0) {
    const double margin_m = 0.5 * (fitting_m + too_wide_m);
    (fits(within(margin_m)) ? fitting_m : too_wide_m) = margin_m;
  }
  return within(fitting_m);
}

/// Height of the ground; NaN where unknown.
double height_at(CellLookup& lookup, const TraversabilityView& view,
                 const Eigen::Vector2d& position_map) {
  const auto cell = view.cell_of(position_map);
  const SurfaceCell* surface = cell ? lookup.at(*cell).surface : nullptr;
  return surface != nullptr && surface->ground.is_known()
             ? surface->ground.height_m
             : std::numeric_limits<double>::quiet_NaN();
}

/// Why the robot does not stand on the ground that the map has at the start; empty where it does or
/// nobody knows. The map has one layer of ground: below a bridge, the lower one.
std::string fault_of_level(const TraversabilityView& view, const Goal& from) {
  if (!from.height_m) return {};
  // Of storeys and bridges, less what the ground may be off.
  constexpr double storey_m = 2.0;
  CellLookup lookup(view);
  const double above_m = *from.height_m - height_at(lookup, view, from.position_map);
  // Also where the ground is unknown.
  if (!(above_m > view.profile.height_m + storey_m) && !(above_m < -storey_m)) return {};
  std::ostringstream text;
  text << "'" << view.profile.name << "' is not on the ground that the map has at "
       << text_of(from.position_map) << ", which lies " << std::abs(above_m) << " m "
       << (above_m > 0.0 ? "below" : "above")
       << " it: of levels above each other, as of a bridge and what is below, the map has one";
  return text.str();
}

void set_poses(const TraversabilityView& view, std::span<const PathPoint> path, PathPlan& plan) {
  CellLookup lookup(view);
  plan.poses.clear();
  plan.length_m = plan.reverse_m = 0.0;
  for (const PathPoint& driven : path) {
    plan.length_m += driven.at.step_m;
    if (driven.at.is_reverse) plan.reverse_m += driven.at.step_m;
    plan.poses.push_back({driven.at.pose, height_at(lookup, view, driven.at.pose.position_map),
                          plan.length_m, driven.at.is_reverse});
  }
  plan.cost = path.back().cost;
}

/// Sets the path if check_long_path finds it free; downsampled if it then stays free.
bool set_path(const TraversabilityView& view, const std::vector<PathPoint>& path, PathPlan& plan) {
  constexpr double spacing_m = 0.25;
  for (const std::vector<PathPoint>& candidate : {downsampled(path, spacing_m), path}) {
    set_poses(view, candidate, plan);
    const PathCheck check = check_long_path(view, plan.path_map());
    if (!check.is_free) continue;
    plan.clearance_m = check.clearance_m;
    plan.inferred_m = check.inferred_m;
    return true;
  }
  plan.poses.clear();
  return false;
}

struct FoundPath {
  std::vector<PathPoint> poses;
  /// If not, it leads to the nearest pose reached.
  bool reaches_goal = false;
};

/// Whether the path costs about as much as the coarse route, plus turns at both ends.
bool is_good(const FoundPath& path, const CoarseRoute& route, const RobotProfile& profile) {
  constexpr double factor = 1.1;
  constexpr double turns_in_radii = 4.0;
  return path.reaches_goal &&
         path.poses.back().cost <
             factor * route.cost + turns_in_radii * profile.min_turning_radius_m;
}

bool is_better(const FoundPath& a, const FoundPath& b) {
  if (a.reaches_goal != b.reaches_goal) return a.reaches_goal;
  return a.poses.back().cost < b.poses.back().cost;
}

std::vector<PathPoint> smoothed(const CollisionChecker& checker, std::vector<PathPoint> path,
                                std::span<const PlanarPose> goals, int attempts,
                                const PlanningConfig& config) {
  return smooth_path(checker, std::move(path), goals, attempts, config.seed, config.should_stop);
}

std::optional<FoundPath> attempt(const CollisionChecker& checker, const CoarseRoute& route,
                                 std::span<const PlanarPose> starts,
                                 std::span<const PlanarPose> goals, const PlanningConfig& config,
                                 std::uint32_t seed, std::uint64_t& steps) {
  PoseSampler sampler(checker.grid(), route, config.route_guided, seed);
  PlanningConfig single = config;
  single.seed = seed;
  single.max_steps -= steps;
  const SearchResult found = search_path(checker, sampler, starts, goals, single);
  steps += found.steps;
  if (found.waypoints.empty()) return std::nullopt;
  auto poses = connect_waypoints(checker, found.waypoints);
  if (!poses) return std::nullopt;
  // Enough smoothing to compare it with others.
  const int attempts = found.reaches_goal ? config.smoothing_attempts / 4 : 0;
  return FoundPath{smoothed(checker, *std::move(poses), goals, attempts, config),
                   found.reaches_goal};
}

/// The cheapest path of several searches with different seeds, smoothed: the first path of a search
/// may be half in reverse. Stops at a path that costs about as much as the coarse route. Adds the
/// steps used to `steps`.
std::optional<FoundPath> find_best_path(const CollisionChecker& checker, const CoarseRoute& route,
                                        std::span<const PlanarPose> starts,
                                        std::span<const PlanarPose> goals,
                                        const PlanningConfig& config, std::uint64_t& steps) {
  std::optional<FoundPath> best;
  for (std::uint32_t i = 0; i < config.max_attempts && steps < config.max_steps; ++i) {
    auto path = attempt(checker, route, starts, goals, config, config.seed + i, steps);
    if (path && (!best || is_better(*path, *best))) best = std::move(path);
    if (best && is_good(*best, route, checker.grid().profile())) break;
    if (config.should_stop && config.should_stop()) break;
  }
  if (best && best->reaches_goal) {
    best->poses =
        smoothed(checker, std::move(best->poses), goals, config.smoothing_attempts, config);
  }
  return best;
}

/// The search between a start and a goal that are free.
class Search {
 public:
  /// Within the box, which holds both.
  Search(const TraversabilityView& view, const Goal& from, const Goal& to,
         const Eigen::AlignedBox2d& box, const PlanningConfig& config)
      : view_(view),
        config_(config),
        from_(from),
        to_(to),
        is_whole_map_(box.contains(view.bounds_map())),
        grid_(view, box, config.cost_weight, config.should_stop),
        checker_(grid_, config.reverse_factor) {}

  [[nodiscard]] PathPlan run(std::span<const PlanarPose> starts,
                             std::span<const PlanarPose> goals) const {
    const auto route =
        find_coarse_route(grid_, from_.position_map, to_.position_map, config_.should_stop);
    if (!route) {
      return failed(view_, PlanStatus::no_path,
                    "no known path from " + text_of(from_.position_map) + " to " +
                        text_of(to_.position_map) + " is wide enough for '" + view_.profile.name +
                        "'; map more, or allow unknown ground" +
                        (is_whole_map_ ? ""
                                       : ". The map is larger than can be searched: a way far "
                                         "round is not seen, and intermediate goals help"));
    }
    PathPlan plan = failed(view_, PlanStatus::out_of_time, "");
    plan.route_m = route->length_m;
    const auto best = find_best_path(checker_, *route, starts, goals, config_, plan.steps);
    if (best && set_path(view_, best->poses, plan) && best->reaches_goal) {
      plan.status = PlanStatus::found;
    } else {
      plan.reason = reason_for(plan, goals);
    }
    return plan;
  }

 private:
  [[nodiscard]] std::string reason_for(const PathPlan& plan,
                                       std::span<const PlanarPose> goals) const {
    std::ostringstream text;
    text << "no path to " << text_of(goals.front().position_map) << " was found in " << plan.steps
         << " iterations";
    if (!plan.poses.empty()) {
      const Eigen::Vector2d& end = plan.poses.back().pose.position_map;
      text << "; the nearest place reached is " << text_of(end) << ", "
           << (end - goals.front().position_map).norm() << " m from it";
    }
    text << "; allow more time or iterations";
    return text.str();
  }

  const TraversabilityView& view_;
  const PlanningConfig& config_;
  const Goal& from_;
  const Goal& to_;
  bool is_whole_map_;
  PlanningGrid grid_;
  CollisionChecker checker_;
};

/// Whether the start is at the goal.
bool is_at_goal(const PlanarPose& start, const Goal& to) {
  constexpr double same_m = 1e-3;
  constexpr double same_rad = 1e-3;
  if ((start.position_map - to.position_map).norm() > same_m) return false;
  return !to.heading_rad ||
         std::abs(std::remainder(start.heading_rad - *to.heading_rad, 2.0 * pi)) <= same_rad;
}

std::optional<PathPlan> refusal(const TraversabilityView& view, const Goal& from, const Goal& to) {
  using enum PlanStatus;
  if (view.tiles.empty()) return failed(view, no_path, TraversabilityView::nothing_known);
  const std::string from_fault = fault_of(view, from);
  if (!from_fault.empty()) return failed(view, invalid_request, "start: " + from_fault);
  const std::string to_fault = fault_of(view, to);
  if (!to_fault.empty()) return failed(view, invalid_request, "goal: " + to_fault);
  if (search_box(view, from, to)) return std::nullopt;
  Eigen::AlignedBox2d ends(from.position_map);
  ends.extend(to.position_map);
  std::ostringstream text;
  text << "start and goal span " << PlanningGrid::cells_for(ends, view.cell_m) << " cells; at most "
       << PlanningGrid::max_cells << " can be searched: name a goal on the way";
  return failed(view, invalid_request, text.str());
}

}  // namespace

PathPlan plan_path(const TraversabilityView& view, const Goal& from, const Goal& to,
                   const PlanningConfig& config) {
  const std::string faults = config.faults();
  if (!faults.empty()) throw std::invalid_argument("planning: " + faults);
  if (auto refused = refusal(view, from, to)) return *std::move(refused);
  if (const std::string fault = fault_of_level(view, from); !fault.empty())
    return failed(view, PlanStatus::start_blocked, fault);
  const FreePoses start = free_poses_at(view, from);
  if (start.poses.empty()) return blocked(view, PlanStatus::start_blocked, from, start);
  const FreePoses goal = free_poses_at(view, to);
  if (goal.poses.empty()) return blocked(view, PlanStatus::goal_blocked, to, goal);
  if (is_at_goal(start.poses.front(), to)) {
    PathPlan plan = failed(view, PlanStatus::found, "");
    (void)set_path(view, {{{start.poses.front(), 0.0, false}, 0.0}}, plan);
    return plan;
  }
  try {
    return Search(view, from, to, *search_box(view, from, to), config).run(start.poses, goal.poses);
  } catch (const PlanningStopped& stopped) {
    return failed(view, PlanStatus::out_of_time,
                  std::string("stopped while ") + stopped.what() + ", before any path to " +
                      text_of(to.position_map) + " was looked for; allow more time");
  }
}

std::string_view name(PlannerKind kind) {
  constexpr std::array<std::string_view, planner_kind_count> names{"rrt-connect", "rrt-star",
                                                                   "bit-star"};
  return names.at(static_cast<std::size_t>(kind));
}

std::string PlanningConfig::faults() const {
  std::ostringstream faults;
  if (!(cost_weight >= 0.0 && cost_weight <= 1e3)) {
    faults << "cost_weight = " << cost_weight << "; must be 0 to 1000\n";
  }
  if (!(reverse_factor >= 1.0 && reverse_factor <= 1e3)) {
    faults << "reverse_factor = " << reverse_factor << "; must be 1 to 1000\n";
  }
  if (seed == 0) faults << "seed = 0; must be 1 or more\n";
  return faults.str();
}

std::string_view name(PlanStatus status) {
  constexpr std::array<std::string_view, 6> names{
      "found", "invalid request", "start blocked", "goal blocked", "no path", "out of time"};
  return names.at(static_cast<std::size_t>(status));
}

std::vector<PlanarPose> PathPlan::path_map() const {
  std::vector<PlanarPose> path;
  path.reserve(poses.size());
  for (const PlannedPose& planned : poses) path.push_back(planned.pose);
  return path;
}

}  // namespace stillmap
