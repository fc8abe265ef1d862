#include "core/planning/path_smoother.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

namespace stillmap {
namespace {

/// Index of the pose about `length_m` after `from`.
std::size_t index_after(std::span<const PathPoint> path, std::size_t from, double length_m) {
  std::size_t to = from;
  for (double driven_m = 0.0; to + 1 < path.size() && driven_m < length_m;) {
    driven_m += path[++to].at.step_m;
  }
  return to;
}

/// Replaces the poses in (from, to] by `shortcut`, whose costs count from `from`.
void replace(std::vector<PathPoint>& path, std::size_t from, std::size_t to,
             std::vector<PathPoint> shortcut) {
  const double cost_at_start = path[from].cost;
  for (PathPoint& pose : shortcut) pose.cost += cost_at_start;
  const double end_cost = shortcut.empty() ? cost_at_start : shortcut.back().cost;
  const double saved = path[to].cost - end_cost;
  for (std::size_t i = to + 1; i < path.size(); ++i) path[i].cost -= saved;
  const auto first = path.begin() + static_cast<std::ptrdiff_t>(from) + 1;
  const auto last = path.begin() + static_cast<std::ptrdiff_t>(to) + 1;
  path.insert(path.erase(first, last), shortcut.begin(), shortcut.end());
}

std::optional<std::vector<PathPoint>> connect_via(const CollisionChecker& checker,
                                                  const PlanarPose& a, const PlanarPose& middle,
                                                  const PlanarPose& b) {
  auto path = connect_waypoints(checker, std::array{a, middle, b});
  if (path) path->erase(path->begin());
  return path;
}

/// Random numbers that do not depend on the standard library.
class Random {
 public:
  explicit Random(std::uint32_t seed) : engine_(seed) {}

  /// In [0, 1).
  double uniform() { return static_cast<double>(engine_() >> 11U) * 0x1.0p-53; }

  /// In [0, count). @pre count > 0
  std::size_t below(std::size_t count) {
    return std::min(static_cast<std::size_t>(uniform() * static_cast<double>(count)), count - 1);
  }

  PlanarPose near(PlanarPose pose) {
    constexpr double reach_m = 1.5;
    constexpr double reach_rad = 0.3;
    const double size = uniform();
    pose.position_map += size * reach_m * Eigen::Vector2d(symmetric(), symmetric());
    pose.heading_rad += size * reach_rad * symmetric();
    return pose;
  }

 private:
  double symmetric() { return 2.0 * uniform() - 1.0; }

  std::mt19937_64 engine_;
};

}  // namespace

std::optional<std::vector<PathPoint>> connect_waypoints(const CollisionChecker& checker,
                                                        std::span<const PlanarPose> waypoints) {
  std::vector<PathPoint> path{{{waypoints.front(), 0.0, false}, 0.0}};
  for (std::size_t i = 1; i < waypoints.size(); ++i) {
    const auto driven = checker.connect(waypoints[i - 1], waypoints[i]);
    if (!driven) return std::nullopt;
    const double cost_so_far = path.back().cost;
    for (PathPoint pose : *driven) {
      pose.cost += cost_so_far;
      path.push_back(pose);
    }
  }
  return path;
}

std::vector<PathPoint> smooth_path(const CollisionChecker& checker, std::vector<PathPoint> path,
                                   std::span<const PlanarPose> ends, int attempts,
                                   std::uint32_t seed, const std::function<bool()>& should_stop) {
  constexpr double min_shortcut_m = 2.0;
  constexpr double max_shortcut_m = 80.0;
  constexpr double min_gain = 0.01;
  Random random(seed);
  for (int i = 0; i < attempts && path.size() > 2; ++i) {
    if (should_stop && should_stop()) break;
    const std::size_t from = random.below(path.size() - 1);
    // Log-uniform: short detours need as many attempts as long ones.
    const double length_m =
        min_shortcut_m * std::pow(max_shortcut_m / min_shortcut_m, random.uniform());
    const std::size_t to = index_after(path, from, length_m);
    const PlanarPose& a = path[from].at.pose;
    const bool is_end = to + 1 == path.size() && !ends.empty();
    const PlanarPose& b = is_end ? ends[random.below(ends.size())] : path[to].at.pose;
    // Direct, or via a pose near the middle of the replaced part.
    auto shortcut = i % 2 == 0
                        ? checker.connect(a, b)
                        : connect_via(checker, a, random.near(path[(from + to) / 2].at.pose), b);
    if (!shortcut || shortcut->empty()) continue;
    if (shortcut->back().cost + min_gain > path[to].cost - path[from].cost) continue;
    replace(path, from, to, *std::move(shortcut));
  }
  return path;
}

std::vector<PathPoint> downsampled(std::span<const PathPoint> path, double spacing_m) {
  std::vector<PathPoint> kept;
  double since_last_m = 0.0;
  for (std::size_t i = 0; i < path.size(); ++i) {
    since_last_m += path[i].at.step_m;
    const bool is_end = i == 0 || i + 1 == path.size();
    const bool is_reversal = !is_end && path[i + 1].at.is_reverse != path[i].at.is_reverse && i > 0;
    if (!is_end && !is_reversal && since_last_m + path[i + 1].at.step_m <= spacing_m) continue;
    kept.push_back(path[i]);
    kept.back().at.step_m = since_last_m;
    since_last_m = 0.0;
  }
  return kept;
}

}  // namespace stillmap
