#include "core/lidar/turn_parts.hpp"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <functional>
#include <numbers>
#include <utility>

#include "core/lidar/measured_elevation.hpp"
#include "core/lidar/sweep_merger.hpp"

namespace stillmap {
namespace {

constexpr int bins = 360;
constexpr double max_turn_s = 1.0;

double positive_deg(double angle_deg) {
  const double rest = std::fmod(angle_deg, 360.0);
  return rest < 0.0 ? rest + 360.0 : rest;
}

double middle_deg(const ViewedArc& arc) { return arc.begin_deg + 0.5 * arc.width_deg; }

/// How much of both arcs is common [degrees].
double common_deg(const ViewedArc& a, const ViewedArc& b) {
  const double shift = positive_deg(b.begin_deg - a.begin_deg);
  const double first = std::min(a.width_deg - shift, b.width_deg);
  const double round_again = std::min(shift + b.width_deg - 360.0, a.width_deg);
  return std::max(first, 0.0) + std::max(round_again, 0.0);
}

/// Whether the lidar looks where it looked before.
bool is_same_view(const ViewedArc& a, const ViewedArc& b) {
  constexpr double same_share = 0.7;
  return common_deg(a, b) > same_share * std::min(a.width_deg, b.width_deg);
}

/// How far clouds have led round, by the directions of their middles.
class WayRound {
 public:
  /// `clouds` after the last arc: more than one where those between showed nothing.
  void add(const ViewedArc& arc, std::size_t clouds) {
    if (!arcs_.empty()) {
      clouds_ += clouds;
      const double step = positive_deg(middle_deg(arc) - middle_deg(arcs_.back()));
      anticlockwise_deg_ += step;
      clockwise_deg_ += 360.0 - step;
    }
    arcs_.push_back(arc);
  }

  /// Halves lead as far one way as the other.
  [[nodiscard]] double turned_deg() const { return std::min(anticlockwise_deg_, clockwise_deg_); }
  [[nodiscard]] double step_deg() const { return turned_deg() / static_cast<double>(clouds_); }
  [[nodiscard]] bool is_twice_round() const {
    return arcs_.size() > 1 && turned_deg() > 720.0 - 0.5 * step_deg();
  }

  [[nodiscard]] double widest_deg() const {
    return std::ranges::max(arcs_, {}, &ViewedArc::width_deg).width_deg;
  }

  /// Of all directions [degrees].
  [[nodiscard]] int seen_deg() const {
    std::array<bool, bins> seen{};
    for (const ViewedArc& arc : arcs_)
      for (int k = 0; k < std::lround(arc.width_deg); ++k)
        seen.at(static_cast<std::size_t>(std::lround(arc.begin_deg) + k) % bins) = true;
    return static_cast<int>(std::ranges::count(seen, true));
  }

 private:
  std::vector<ViewedArc> arcs_;
  /// After the first arc, up to the last one.
  std::size_t clouds_ = 0;
  double anticlockwise_deg_ = 0.0;
  double clockwise_deg_ = 0.0;
};

/// The fewest clouds that show all round, but for a tenth of one: a seam that is not seen is less
/// than another cloud in the scan.
std::size_t clouds_per_turn(const WayRound& way) {
  constexpr double may_lack = 0.3;
  // Beams that do not fire in line widen what a part shows, and the sky narrows it: steps tell. But
  // those of more than half a turn look like shorter ones the other way round.
  constexpr double half_deg = 180.0;
  double clouds = 360.0 / way.step_deg();
  if (way.widest_deg() > half_deg) clouds = std::min(clouds, 360.0 / way.widest_deg());
  return static_cast<std::size_t>(std::max(1.0, std::ceil(clouds - may_lack)));
}

}  // namespace

std::optional<ViewedArc> viewed_arc(std::span<const Eigen::Vector3f> points_lidar) {
  constexpr std::size_t enough = 8000, min_points = 20;
  // Odd, so that clouds stored column by column do not show one ring alone.
  const std::size_t step = (points_lidar.size() / enough) | 1U;
  std::array<bool, bins> seen{};
  std::size_t measured = 0;
  for (std::size_t i = 0; i < points_lidar.size(); i += step) {
    const Eigen::Vector3f& p = points_lidar[i];
    if (!is_measured(p)) continue;
    ++measured;
    const double azimuth_deg = std::atan2(p.y(), p.x()) * 180.0 / std::numbers::pi;
    seen.at(static_cast<std::size_t>(positive_deg(azimuth_deg)) % bins) = true;
  }
  if (measured < min_points) return std::nullopt;
  // The widest gap, round by the seam.
  int gap = 0, gap_end = 0, empty = 0;
  for (int k = 0; k < 2 * bins; ++k) {
    empty = seen.at(static_cast<std::size_t>(k % bins)) ? 0 : empty + 1;
    if (empty <= gap) continue;
    gap = empty;
    gap_end = k + 1;
  }
  return ViewedArc{.begin_deg = static_cast<double>(gap_end % bins),
                   .width_deg = static_cast<double>(bins - gap)};
}

TurnJudgement judge_turns(std::span<const CloudView> clouds) {
  // Steps between rays of 300 degrees and more, and hidden sectors, are of whole turns.
  constexpr double whole_deg = 300.0;
  // No lidar that looks one way sees so far round, whatever of it is seen.
  constexpr int min_seen_deg = 200;
  WayRound way;
  std::optional<ViewedArc> last;
  std::size_t since_last = 0;
  for (const auto& [stamp_ns, arc] : clouds) {
    const double lasted_s = 1e-9 * static_cast<double>(stamp_ns - clouds.front().stamp_ns);
    // Not twice round after two of the slowest turns.
    if (lasted_s > 2.0 * max_turn_s) return {.verdict = TurnVerdict::whole};
    ++since_last;
    if (!arc) continue;
    if (arc->width_deg >= whole_deg || (last && is_same_view(*last, *arc)))
      return {.verdict = TurnVerdict::whole};
    last = arc;
    way.add(*arc, std::exchange(since_last, 0));
    if (!way.is_twice_round()) continue;
    if (way.seen_deg() < min_seen_deg) return {.verdict = TurnVerdict::whole};
    const std::size_t parts = clouds_per_turn(way);
    const bool is_slow = 360.0 * lasted_s > max_turn_s * way.turned_deg();
    if (is_slow || parts < 2) return {.verdict = TurnVerdict::whole};
    return {.verdict = TurnVerdict::parts, .clouds_per_turn = parts};
  }
  return {};
}

bool TurnRecognition::comes_late(std::int64_t stamp_ns) {
  const std::int64_t step_ns = last_ns_ ? stamp_ns - *last_ns_ : 0;
  last_ns_ = stamp_ns;
  // Steps from part to part may differ, as where two lidars take turns, but what is usual is so
  // more than once.
  std::vector<std::int64_t> sorted = steps_ns_;
  std::ranges::sort(sorted, std::greater<>());
  const std::int64_t usual_ns = sorted.empty() ? 0 : sorted[sorted.size() > 2 ? 1 : 0];
  if (steps_ns_.size() == max_steps) steps_ns_.erase(steps_ns_.begin());
  steps_ns_.push_back(step_ns);
  return usual_ns > 0 && 2 * step_ns > 3 * usual_ns;
}

bool TurnRecognition::is_open_long(std::int64_t stamp_ns) const {
  constexpr double longest_s = 4.0;
  return clouds_per_turn_ == 0 &&
         std::abs(1e-9 * static_cast<double>(stamp_ns - open_since_ns_)) > longest_s;
}

void TurnRecognition::learn(const CloudView& view) {
  if (comes_late(view.stamp_ns)) run_.clear();
  if (run_.empty() && !view.arc) return;
  if (!std::exchange(is_open_, true)) open_since_ns_ = view.stamp_ns;
  run_.push_back(view);
  const TurnJudgement judgement = judge_turns(run_);
  const bool is_given_up = run_.size() >= max_run || is_open_long(view.stamp_ns);
  if (judgement.verdict == TurnVerdict::open && !is_given_up) return;
  run_ = {view};
  if (judgement.verdict == TurnVerdict::parts) {
    same_views_ = 0;
    // Another number counts once it is found twice: clouds may have been lost unnoticed.
    const std::size_t before = std::exchange(last_found_, judgement.clouds_per_turn);
    if (clouds_per_turn_ <= 1 || before == last_found_) clouds_per_turn_ = last_found_;
  } else if (clouds_per_turn_ <= 1 || ++same_views_ >= views_to_withdraw) {
    same_views_ = 0;
    clouds_per_turn_ = 1;
  }
}

std::size_t TurnCounter::clouds_since(std::int64_t stamp_ns) {
  // What is left of a step's scatter counts as none lost.
  constexpr double may_be_late = 0.1;
  if (!last_ns_ || stamp_ns <= *last_ns_) return 0;
  const std::int64_t step_ns = stamp_ns - *last_ns_;
  if (1e-9 * static_cast<double>(step_ns) > max_turn_s) return 0;
  std::vector<std::int64_t> sorted = steps_ns_;
  if (steps_ns_.size() == max_steps) steps_ns_.erase(steps_ns_.begin());
  steps_ns_.push_back(step_ns);
  if (sorted.empty()) return 1;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::ranges::nth_element(sorted, middle);
  const double steps = static_cast<double>(step_ns) / static_cast<double>(*middle);
  return static_cast<std::size_t>(std::max(1.0, std::round(steps - may_be_late)));
}

bool TurnCounter::begins_turn(std::int64_t stamp_ns) {
  const std::size_t since = clouds_since(stamp_ns);
  last_ns_ = stamp_ns;
  const bool goes_on = filled_ > 0 && since > 0 && filled_ + since <= clouds_per_turn_;
  filled_ = goes_on ? filled_ + since : 1;
  return !goes_on;
}

Scan joined_turn(std::vector<Scan> parts) {
  assert(!parts.empty());
  if (parts.size() == 1) return std::move(parts.front());
  const bool have_rings = std::ranges::all_of(
      parts, [](const Scan& part) { return part.empty() || !part.ring.empty(); });
  std::vector<std::uint16_t> ring;
  if (have_rings)
    for (const Scan& part : parts) ring.insert(ring.end(), part.ring.begin(), part.ring.end());
  Scan turn = merged_scan(std::move(parts));
  turn.ring = std::move(ring);
  return turn;
}

}  // namespace stillmap
