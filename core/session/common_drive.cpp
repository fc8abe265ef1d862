#include "core/session/common_drive.hpp"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <tuple>
#include <utility>
#include <vector>

#include "core/lidar/ranked_value.hpp"

namespace stillmap {
namespace {

// A correction is spread evenly over the scans of a submap: what steps differ by then grows
// steadily, by some thousandths of their jumps. The jumps of two drives differ by more than they
// are long.
constexpr double largest_share = 0.05;

// Steps are of poses whose digits end there, some km from the origin.
constexpr double rounding_m = 1e-9;

// A jump is of four poses.
constexpr std::size_t poses_more = 3;

// As many jumps in a row tell where to look closer.
constexpr std::size_t seed_jumps = 3;

// What must match more often than not, net of what does not: in eight poses that are all that the
// paths could have in common, every jump. Two lidars on one robot that is shaken match in every
// third; never in so many more than they do not.
constexpr std::size_t min_score = 5;
constexpr std::size_t sure_score = 40;

/// The motion along a path, which is the same in every frame of the map.
struct Motion {
  /// From each pose to the next one.
  std::vector<std::int64_t> intervals_ns;
  /// Second differences of the steps from pose to pose, each in the frame of its first pose [m]:
  /// what changes steadily is in none of them. Zero where they are lost in rounding, or no numbers.
  std::vector<Eigen::Vector3d> jumps;
  double median_jump_m = 0.0;
};

Motion motion_of(const Trajectory& path) {
  Motion motion;
  std::vector<Eigen::Vector3d> steps;
  std::vector<double> lengths_m;
  for (std::size_t i = 1; i < path.size(); ++i) {
    motion.intervals_ns.push_back(path[i].stamp_ns - path[i - 1].stamp_ns);
    steps.push_back((path[i - 1].T_map_lidar.inverse() * path[i].T_map_lidar).translation());
    if (steps.size() < poses_more) continue;
    const Eigen::Vector3d jump = steps[i - 1] - 2.0 * steps[i - 2] + steps[i - 3];
    const double length_m = jump.norm();
    const bool is_told = std::isfinite(length_m) && length_m > rounding_m;
    motion.jumps.push_back(is_told ? jump : Eigen::Vector3d(0.0, 0.0, 0.0));
    if (is_told) lengths_m.push_back(length_m);
  }
  motion.median_jump_m = lengths_m.empty() ? 0.0 : median_of(lengths_m);
  return motion;
}

/// Some jumps in a row, so that those of one drive are in the same cell or the next one.
class Seeds {
 public:
  /// Cells of the logarithms of their lengths.
  using Cell = std::tuple<std::int64_t, std::int64_t, std::int64_t>;

  explicit Seeds(const Motion& motion) {
    for (std::size_t i = 0; i + seed_jumps <= motion.jumps.size(); ++i) {
      if (const auto cell = cell_of(motion, i)) entries_.push_back({hash_of(motion, i, *cell), i});
    }
    std::ranges::sort(entries_);
  }

  /// Calls `found` with the positions of those that may be as the one of `motion` at `i`.
  template <typename Found>
  void find(const Motion& motion, std::size_t i, const Found& found) const {
    const auto cell = cell_of(motion, i);
    if (!cell) return;
    const auto& [x, y, z] = *cell;
    for (int neighbour = 0; neighbour < 27; ++neighbour) {
      const Cell near{x + neighbour % 3 - 1, y + neighbour / 3 % 3 - 1, z + neighbour / 9 - 1};
      const std::uint64_t hash = hash_of(motion, i, near);
      auto entry = std::ranges::lower_bound(entries_, Entry{hash, 0});
      for (; entry != entries_.end() && entry->first == hash; ++entry) found(entry->second);
    }
  }

 private:
  using Entry = std::pair<std::uint64_t, std::size_t>;

  static std::optional<Cell> cell_of(const Motion& motion, std::size_t i) {
    const auto index = [](const Eigen::Vector3d& jump) {
      // Of lengths that differ by the largest share, these are no farther apart.
      return std::llround(std::floor(std::log(jump.norm()) / -std::log1p(-largest_share)));
    };
    for (std::size_t j = i; j < i + seed_jumps; ++j) {
      if (motion.jumps[j].isZero(0.0)) return std::nullopt;
    }
    return Cell{index(motion.jumps[i]), index(motion.jumps[i + 1]), index(motion.jumps[i + 2])};
  }

  /// Of the cell and of the stamps of its poses. Two that are equal by chance are looked at.
  static std::uint64_t hash_of(const Motion& motion, std::size_t i, const Cell& cell) {
    std::uint64_t hash = 0;
    const auto add = [&hash](std::int64_t value) {
      hash = (hash ^ static_cast<std::uint64_t>(value)) * 0x9E3779B97F4A7C15U;
      hash ^= hash >> 29U;
    };
    const auto& [x, y, z] = cell;
    add(x);
    add(y);
    add(z);
    for (std::size_t j = i; j + 1 < i + seed_jumps + poses_more; ++j) add(motion.intervals_ns[j]);
    return hash;
  }

  std::vector<Entry> entries_;
};

/// Looks at two motions side by side, so that one's jump `i` is beside the other's jump `k`.
class Comparison {
 public:
  Comparison(const Motion& a, const Motion& b)
      : a_(a), b_(b), typical_m_(std::min(a.median_jump_m, b.median_jump_m)) {}

  /// Whether some of the common stretch round a seed is of one drive.
  [[nodiscard]] std::optional<CommonStretch> stretch_about(std::size_t i, std::size_t k) const {
    for (std::size_t j = 0; j < seed_jumps; ++j) {
      if (!are_stamps_equal(i + j, k + j) || !matches(i + j, k + j)) return std::nullopt;
    }
    const Side before = side(i, k, -1);
    const Side after = side(i + seed_jumps - 1, k + seed_jumps - 1, 1);
    const std::size_t both = before.jumps + seed_jumps + after.jumps;
    const std::size_t wanted = std::clamp(both / 2, min_score, sure_score);
    if (before.score + seed_jumps + after.score < wanted) return std::nullopt;
    return CommonStretch{.first_a = i - before.best_jumps,
                         .first_b = k - before.best_jumps,
                         .poses = before.best_jumps + seed_jumps + after.best_jumps + poses_more};
  }

 private:
  /// What goes on alike by its stamps, no farther than is needed to tell.
  struct Side {
    std::size_t jumps = 0;
    /// The farthest that has the best score: how many more match than do not.
    std::size_t best_jumps = 0;
    std::size_t score = 0;
  };

  /// Of the four poses of a jump.
  [[nodiscard]] bool are_stamps_equal(std::size_t i, std::size_t k) const {
    return std::equal(&a_.intervals_ns[i], &a_.intervals_ns[i] + poses_more, &b_.intervals_ns[k]);
  }

  [[nodiscard]] bool matches(std::size_t i, std::size_t k) const {
    const double length_m = a_.jumps[i].norm();
    return length_m > 0.0 &&
           (a_.jumps[i] - b_.jumps[k]).norm() < largest_share * std::min(length_m, typical_m_);
  }

  /// The jumps before these two, or after them.
  [[nodiscard]] Side side(std::size_t i, std::size_t k, int direction) const {
    Side side;
    std::ptrdiff_t score = 0;
    for (;;) {
      // Below zero it is beyond every size.
      i += static_cast<std::size_t>(direction);
      k += static_cast<std::size_t>(direction);
      if (i >= a_.jumps.size() || k >= b_.jumps.size() || !are_stamps_equal(i, k)) return side;
      ++side.jumps;
      score += matches(i, k) ? 1 : -1;
      const auto best = static_cast<std::ptrdiff_t>(side.score);
      if (score >= best) {
        side.score = static_cast<std::size_t>(score);
        side.best_jumps = side.jumps;
      } else if (best - score > static_cast<std::ptrdiff_t>(2 * sure_score)) {
        return side;
      }
    }
  }

  const Motion& a_;
  const Motion& b_;
  double typical_m_;
};

}  // namespace

std::optional<CommonStretch> common_stretch(const Trajectory& a, const Trajectory& b) {
  const Motion of_a = motion_of(a);
  const Motion of_b = motion_of(b);
  const Comparison comparison(of_a, of_b);
  const Seeds seeds(of_b);
  std::optional<CommonStretch> common;
  for (std::size_t i = 0; i + seed_jumps <= of_a.jumps.size() && !common; ++i) {
    seeds.find(of_a, i, [&](std::size_t k) {
      if (!common) common = comparison.stretch_about(i, k);
    });
  }
  return common;
}

}  // namespace stillmap
