#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

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

}  // namespace stillmap
