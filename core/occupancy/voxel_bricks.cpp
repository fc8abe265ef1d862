#include "core/occupancy/voxel_bricks.hpp"

#include <algorithm>

namespace stillmap {
namespace {

/// Puts two zero bits between the bits of a 14-bit number.
std::uint64_t spread(std::uint64_t bits) {
  bits = (bits | bits << 16U) & 0x030000FF0000FFULL;
  bits = (bits | bits << 8U) & 0x0300F00F00F00FULL;
  bits = (bits | bits << 4U) & 0x030C30C30C30C3ULL;
  return (bits | bits << 2U) & 0x09249249249249ULL;
}

/// Of a brick's key: x, y and z, 14 bits each.
std::uint64_t order_of(std::uint64_t key) {
  constexpr std::uint64_t all = (1U << 14U) - 1U;
  return spread(key >> 28U) | spread(key >> 14U & all) << 1U | spread(key & all) << 2U;
}

}  // namespace

void VoxelBricks::clear() {
  bricks_.clear();
  index_.clear();
  last_key_ = no_key;
}

VoxelBrick& VoxelBricks::find_or_make(std::uint64_t key) {
  const auto [entry, is_new] = index_.try_emplace(key, static_cast<std::uint32_t>(bricks_.size()));
  if (is_new) bricks_.push_back({.order = order_of(key)});
  last_key_ = key;
  last_ = entry->second;
  return bricks_[last_];
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
