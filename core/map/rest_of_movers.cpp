#include <array>
#include <cstdlib>

#include "core/map/live_tile.hpp"

namespace stillmap {
namespace {

/// A mover's voxels that touch were seen last in the same or the next scan, at 10 Hz, and for so
/// long at most. Times, not numbers of scans: of a stored map not all of these are known.
constexpr std::int64_t max_apart_ns = 110'000'000;
constexpr std::int64_t max_seen_ns = 500'000'000;
/// So long after a voxel was seen last it will not be seen for longer, nor what was seen with it.
constexpr std::int64_t settled_after_ns = max_seen_ns + max_apart_ns;

/// Where the clock was set back, what was seen last has the earlier stamp.
std::int64_t seen_ns(std::uint32_t first_scan, std::uint32_t last_scan, const ScanStamps& stamps) {
  return std::abs(stamps.stamp_ns(last_scan) - stamps.stamp_ns(first_scan));
}

}  // namespace

template <typename Visit>
void LiveTile::for_each_neighbour(std::uint32_t key, Visit visit) const {
  struct Side {
    int x, y, z;
  };
  constexpr std::array<Side, 6> sides{
      {{-1, 0, 0}, {1, 0, 0}, {0, -1, 0}, {0, 1, 0}, {0, 0, -1}, {0, 0, 1}}};
  const VoxelIndex index = voxel_index(key);
  for (const Side& side : sides) {
    const int x = index.x + side.x, y = index.y + side.y, z = index.z + side.z;
    if (x < 0 || y < 0 || x >= grid_.columns() || y >= grid_.columns()) continue;
    const std::uint32_t beside =
        voxel_key({static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y),
                   static_cast<std::int16_t>(z)});
    const std::uint32_t position = index_.find(beside, key_at());
    if (position != PositionIndex::none) visit(position);
  }
}

bool LiveTile::is_of_mover(const LiveVoxel& voxel, std::int64_t mover_seen_ns,
                           const ScanStamps& stamps, const VisibilityRule& rule) const {
  // Of a part of a mover labels are sure at times, too, and take it for a wall, a bush or a pole;
  // hardly for ground.
  const ClassEvidence& evidence = voxel.packed.evidence;
  const bool is_surely_ground =
      is_ground(evidence.winner()) && evidence.is_sure(voxel.packed.point_count);
  if (is_surely_ground || !is_shown(voxel, rule) || voxel.is_restored != 0 ||
      voxel.packed.point_count == 0)
    return false;
  const std::int64_t apart_ns = stamps.stamp_ns(voxel.last_scan) - mover_seen_ns;
  if (std::abs(apart_ns) > max_apart_ns ||
      seen_ns(voxel.first_scan, voxel.last_scan, stamps) > max_seen_ns)
    return false;
  // What is a part of the static world goes on in that.
  bool touches_static = false;
  for_each_neighbour(voxel.packed.key, [&](std::uint32_t position) {
    const LiveVoxel& beside = at(position);
    touches_static |= seen_ns(beside.first_scan, beside.last_scan, stamps) > max_seen_ns &&
                      is_shown(beside, rule);
  });
  return !touches_static;
}

bool LiveTile::hide_rest_of_movers(const ScanStamps& stamps, std::int64_t now_ns,
                                   const VisibilityRule& rule) {
  std::vector<std::uint32_t> front, later;
  for (const std::uint32_t key : hidden_) {
    const std::uint32_t position = index_.find(key, key_at());
    if (position == PositionIndex::none || is_shown(at(position), rule)) continue;
    const std::int64_t age_ns = std::abs(now_ns - stamps.stamp_ns(at(position).last_scan));
    (age_ns < settled_after_ns ? later : front).push_back(key);
  }
  hidden_ = std::move(later);
  bool hides_one = false;
  while (!front.empty()) {
    const std::uint32_t key = front.back();
    front.pop_back();
    const LiveVoxel& mover = at(index_.find(key, key_at()));
    const std::int64_t mover_seen_ns = stamps.stamp_ns(mover.last_scan);
    for_each_neighbour(key, [&](std::uint32_t position) {
      LiveVoxel& voxel = at(position);
      if (!is_of_mover(voxel, mover_seen_ns, stamps, rule)) return;
      voxel.misses = misses_of_rest;
      hides_one = true;
      front.push_back(voxel.packed.key);
    });
  }
  return hides_one;
}

}  // namespace stillmap
