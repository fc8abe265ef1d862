#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>

#include "core/map/live_tile.hpp"

namespace stillmap {
namespace {

/// Points of a voxel are counted up to here.
constexpr std::uint32_t max_count = std::numeric_limits<std::uint16_t>::max();

}  // namespace

void LiveTile::add_misses(LiveVoxel& voxel, std::uint32_t misses) {
  if (voxel.misses == misses_of_rest) voxel.misses = 0;
  if (voxel.misses + misses > max_misses) {
    // Halved, so that something placed where space was free for long can still become visible.
    voxel.misses = max_misses / 2;
    voxel.hits /= 2;
  }
  voxel.misses = static_cast<std::uint16_t>(voxel.misses + misses) & 0x1FFFU;
}

void LiveTile::forget_beyond(LiveVoxel& voxel, std::uint32_t max_scans,
                             const VisibilityRule& rule) {
  if (voxel.misses == misses_of_rest) {
    voxel.hits = static_cast<std::uint16_t>(std::min<std::uint32_t>(voxel.hits, max_scans));
    return;
  }
  const bool was_seen_through = is_seen_through(voxel, rule);
  const double max_missing =
      std::max<double>(misses_to_clear(voxel, rule), misses_per_hit(voxel, rule) * max_scans);
  const double share = std::min({1.0, max_scans / std::max<double>(voxel.hits, 1.0),
                                 max_missing / std::max<double>(voxel.misses, 1.0)});
  if (share >= 1.0) return;
  const auto shortened = [share](unsigned count) {
    return static_cast<unsigned>(std::lround(share * count));
  };
  voxel.hits =
      static_cast<std::uint16_t>(std::max(shortened(voxel.hits), voxel.hits > 0 ? 1U : 0U));
  voxel.misses = shortened(voxel.misses) & 0x1FFFU;
  // Rounding must not show or hide it.
  while (was_seen_through && !is_seen_through(voxel, rule) && voxel.misses < max_misses)
    voxel.misses = (voxel.misses + 1U) & 0x1FFFU;
  while (!was_seen_through && is_seen_through(voxel, rule))
    voxel.misses = (voxel.misses - 1U) & 0x1FFFU;
}

Thin LiveTile::thin(const LiveVoxel& voxel) {
  const ClassEvidence& evidence = voxel.packed.evidence;
  if (is_thin(evidence.winner()) && evidence.is_sure(voxel.packed.point_count))
    return Thin::by_labels;
  return voxel.is_thin != 0 ? Thin::by_beam : Thin::no;
}

std::uint32_t LiveTile::misses_to_clear(const LiveVoxel& voxel, const VisibilityRule& rule) {
  const bool is_sure = voxel.packed.evidence.is_sure(voxel.packed.point_count);
  return (is_sure ? rule.label_trust : 1) * rule.misses_to_clear;
}

double LiveTile::misses_per_hit(const LiveVoxel& voxel, const VisibilityRule& rule) {
  // The side of a tram or a bus is as flat and as high as a wall, and networks are as sure of it:
  // what stood for long and left would stay. Walls fill their voxels, and need no more than what
  // keeps a grazing ray or two from hiding what few beams hit.
  const ClassEvidence& evidence = voxel.packed.evidence;
  const bool is_trusted =
      evidence.is_sure(voxel.packed.point_count) && evidence.winner() != SemanticClass::building;
  return (is_trusted ? rule.label_trust : 1) * rule.misses_per_hit;
}

bool LiveTile::is_seen_through(const LiveVoxel& voxel, const VisibilityRule& rule) {
  return voxel.is_restored == 0 && voxel.misses >= misses_to_clear(voxel, rule) &&
         voxel.misses > misses_per_hit(voxel, rule) * voxel.hits;
}

bool LiveTile::is_shown(const LiveVoxel& voxel, const VisibilityRule& rule) {
  if (voxel.is_restored != 0) return true;
  return voxel.packed.point_count >= std::min(rule.min_points, max_count) &&
         !is_movable(voxel.packed.evidence.winner()) && !is_seen_through(voxel, rule);
}

std::optional<RemovalReason> LiveTile::removal(const LiveVoxel& voxel, const VisibilityRule& rule) {
  if (is_shown(voxel, rule) || voxel.packed.point_count < rule.min_points) return std::nullopt;
  if (!is_movable(voxel.packed.evidence.winner())) return RemovalReason::seen_through;
  return voxel.was_shown != 0 ? RemovalReason::relabelled : RemovalReason::semi_static;
}

/// Voxels that a scan may have seen through, as many as are asked for at once.
class LiveTile::Look {
 public:
  Look(const LiveTile& tile, const VisibilityTest& test, std::uint32_t scan,
       const VisibilityRule& rule)
      : tile_(tile), test_(test), scan_(scan), rule_(rule) {}

  /// Takes those that count, until it is full; returns the rest.
  std::span<LiveVoxel> take(std::span<LiveVoxel> voxels) {
    std::size_t k = 0;
    for (; k < voxels.size() && count_ < voxels_.size(); ++k)
      if (counts(voxels[k])) voxels_[count_++] = &voxels[k];
    return voxels.subspan(k);
  }
  [[nodiscard]] bool is_full() const { return count_ == voxels_.size(); }

  /// Counts their misses, and calls `hide(voxel)` for each that these hide; empty afterwards.
  template <typename Hide>
  void finish(Hide hide) {
    std::array<std::uint32_t, PlaceToClear::max_at_once> misses{};
    ask([this](const LiveVoxel& voxel) { return is_new(voxel); }, test_.times_free_before, misses);
    ask([this](const LiveVoxel& voxel) { return counts_now(voxel); }, test_.is_free, misses);
    for (std::size_t k = 0; k < count_; ++k) {
      if (misses[k] == 0) continue;
      LiveVoxel& voxel = *voxels_[k];
      const bool was_hidden = is_seen_through(voxel, rule_);
      const bool was_rest = voxel.misses == misses_of_rest;
      add_misses(voxel, misses[k]);
      // Where it takes more misses than these.
      if (was_rest && !is_seen_through(voxel, rule_)) voxel.misses = misses_of_rest;
      if (!was_hidden && is_seen_through(voxel, rule_)) hide(voxel);
    }
    count_ = 0;
  }

 private:
  [[nodiscard]] bool is_new(const LiveVoxel& voxel) const {
    return voxel.first_scan > test_.last_scan_cleared && test_.times_free_before;
  }
  [[nodiscard]] bool counts(const LiveVoxel& voxel) const {
    if (voxel.packed.point_count == 0 || voxel.is_restored != 0) return false;
    if (voxel.last_scan == scan_ && !is_new(voxel)) return false;
    return !test_.only_hit_before_ns ||
           test_.stamps->stamp_ns(voxel.last_scan) < *test_.only_hit_before_ns;
  }
  /// Whether this scan counts, too.
  [[nodiscard]] bool counts_now(const LiveVoxel& voxel) const {
    if (voxel.last_scan == scan_) return false;
    return !test_.only_hides || !is_seen_through(voxel, rule_) || voxel.misses == misses_of_rest;
  }
  /// Adds to `misses` what is answered for those of which `is_asked(voxel)` holds.
  template <typename IsAsked>
  void ask(IsAsked is_asked, const VisibilityTest::Ask& of,
           std::array<std::uint32_t, PlaceToClear::max_at_once>& misses) const {
    std::array<PlaceToClear, PlaceToClear::max_at_once> places;
    std::array<std::uint32_t, PlaceToClear::max_at_once> asked, answers;
    std::uint32_t count = 0;
    for (std::uint32_t k = 0; k < count_; ++k) {
      if (!is_asked(*voxels_[k])) continue;
      places[count] = {tile_.mean_map(*voxels_[k]), thin(*voxels_[k])};
      asked[count++] = k;
    }
    if (count == 0) return;
    of(std::span(places).first(count), std::span(answers).first(count));
    for (std::uint32_t k = 0; k < count; ++k) misses[asked[k]] += answers[k];
  }

  const LiveTile& tile_;
  const VisibilityTest& test_;
  std::uint32_t scan_;
  const VisibilityRule& rule_;
  std::array<LiveVoxel*, PlaceToClear::max_at_once> voxels_;
  std::size_t count_ = 0;
};

bool LiveTile::clear_seen_through(const VisibilityTest& test, std::uint32_t scan,
                                  const VisibilityRule& rule) {
  bool hides_one = false;
  const auto hide = [&](const LiveVoxel& voxel) {
    hides_one = true;
    if (test.stamps != nullptr) hidden_.push_back(voxel.packed.key);
  };
  Look look(*this, test, scan, rule);
  for (auto* const voxels : {&sorted_, &fresh_}) {
    for (std::span<LiveVoxel> rest(*voxels); !rest.empty();) {
      rest = look.take(rest);
      if (look.is_full()) look.finish(hide);
    }
  }
  look.finish(hide);
  if (test.stamps != nullptr)
    hides_one |= hide_rest_of_movers(*test.stamps, test.stamps->stamp_ns(scan), rule);
  return hides_one;
}

}  // namespace stillmap
