#include "core/occupancy/voxel_bricks.hpp"

#include <algorithm>

namespace stillmap {
namespace {

constexpr std::uint64_t no_key = ~std::uint64_t{0};

/// Puts two zero bits between the bits of a 14-bit number.
std::uint64_t spread(std::uint64_t bits) {
  bits = (bits | bits << 16U) & 0x030000FF0000FFULL;
  bits = (bits | bits << 8U) & 0x0300F00F00F00FULL;
  bits = (bits | bits << 4U) & 0x030C30C30C30C3ULL;
  return (bits | bits << 2U) & 0x09249249249249ULL;
}

std::uint64_t part(std::int32_t coordinate) { return static_cast<std::uint64_t>(coordinate) >> 2U; }

/// Octant or child: one bit of each coordinate.
unsigned corner(const VoxelKey& voxel, unsigned bit) {
  return (static_cast<unsigned>(voxel.x()) >> bit & 1U) |
         (static_cast<unsigned>(voxel.y()) >> bit & 1U) << 1U |
         (static_cast<unsigned>(voxel.z()) >> bit & 1U) << 2U;
}

}  // namespace

void VoxelBricks::clear() {
  bricks_.clear();
  index_.clear();
  last_key_ = no_key;
}

VoxelBrick& VoxelBricks::brick_of(const VoxelKey& voxel) {
  const std::uint64_t key = part(voxel.x()) << 28U | part(voxel.y()) << 14U | part(voxel.z());
  if (key == last_key_) return bricks_[last_];
  const auto [entry, is_new] = index_.try_emplace(key, static_cast<std::uint32_t>(bricks_.size()));
  if (is_new) {
    const std::uint64_t order =
        spread(part(voxel.x())) | spread(part(voxel.y())) << 1U | spread(part(voxel.z())) << 2U;
    bricks_.push_back({.order = order});
  }
  last_key_ = key;
  last_ = entry->second;
  return bricks_[last_];
}

std::uint64_t VoxelBricks::bit_of(const VoxelKey& voxel) {
  return std::uint64_t{1} << (8U * corner(voxel, 1) + corner(voxel, 0));
}

std::span<const VoxelBrick> VoxelBricks::sorted() {
  for (VoxelBrick& brick : bricks_) brick.misses &= ~brick.hits;
  std::ranges::sort(bricks_, {}, &VoxelBrick::order);
  // Places in the list are others now.
  index_.clear();
  last_key_ = no_key;
  return bricks_;
}

}  // namespace stillmap
