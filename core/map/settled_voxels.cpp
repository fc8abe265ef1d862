#include <algorithm>
#include <array>
#include <cstdint>

#include "core/map/live_tile.hpp"

namespace stillmap {
namespace {

/// A point this near to another voxel may be of it: what ranges and poses err by [m], and at most
/// so much of a voxel.
constexpr double near_m = 0.05;
constexpr double near_voxels = 0.25;
/// A voxel that one scan alone hit is no surface yet.
constexpr std::uint16_t min_hits = 2;

/// Which way the voxel beside a point is along one axis; 0 where none is near.
int side_of(std::uint8_t offset, std::uint32_t near_steps) {
  if (offset < near_steps) return -1;
  return offset + near_steps >= PackedVoxel::offset_steps ? 1 : 0;
}

}  // namespace

LiveTile::LiveVoxel* LiveTile::find_settled(std::uint32_t key, const TilePoint& point,
                                            const SettledVoxels& settled) {
  LiveVoxel* const voxel = find(key);
  if (voxel == nullptr || voxel->hits < min_hits ||
      settled.stamps.stamp_ns(voxel->first_scan) >= settled.before_ns ||
      !is_shown(*voxel, settled.rule))
    return nullptr;
  const SemanticClass known = voxel->packed.evidence.winner();
  const bool is_other = known != point.label && known != SemanticClass::unlabeled &&
                        point.label != SemanticClass::unlabeled;
  return is_other ? nullptr : voxel;
}

bool LiveTile::add_to_settled(const TilePoint& point, std::uint32_t scan,
                              const SettledVoxels& settled) {
  if (point.motion != Motion::stationary || point.is_thin) return false;
  const auto near_steps = static_cast<std::uint32_t>(
      PackedVoxel::offset_steps * std::min(near_voxels, near_m / grid_.voxel_size_m()));
  std::array<int, 3> side{};
  for (std::size_t axis = 0; axis < 3; ++axis) side[axis] = side_of(point.offset[axis], near_steps);
  if (side == std::array<int, 3>{}) return false;
  const VoxelIndex own = voxel_index(point.voxel_key);
  LiveVoxel* best = nullptr;
  std::array<std::uint8_t, 3> best_offset{};
  // Across a side, an edge or a corner.
  for (unsigned axes = 1; axes < 8; ++axes) {
    std::array<int, 3> step{};
    std::array<std::uint8_t, 3> offset = point.offset;
    bool is_near = true;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if ((axes >> axis & 1U) == 0) continue;
      is_near &= side[axis] != 0;
      step[axis] = side[axis];
      offset[axis] = side[axis] < 0 ? PackedVoxel::offset_steps - 1 : 0;
    }
    const int x = own.x + step[0], y = own.y + step[1];
    if (!is_near || x < 0 || y < 0 || x >= grid_.columns() || y >= grid_.columns()) continue;
    const std::uint32_t key =
        voxel_key({static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y),
                   static_cast<std::int16_t>(own.z + step[2])});
    LiveVoxel* const voxel = find_settled(key, point, settled);
    if (voxel == nullptr || (best != nullptr && best->hits >= voxel->hits)) continue;
    best = voxel;
    best_offset = offset;
  }
  if (best == nullptr) return false;
  TilePoint of_it = point;
  of_it.offset = best_offset;
  hit(*best, std::span(&of_it, 1), scan);
  return true;
}

}  // namespace stillmap
