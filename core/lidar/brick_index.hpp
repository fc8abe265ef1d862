#pragma once

#include <tsl/robin_map.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/lidar/voxel_index.hpp"

namespace stillmap {

/// A number for each voxel of a sparse grid. Only bricks of 4 x 4 x 2 voxels are hashed (ground
/// fills half of one): neighbours in space, which points of a scan mostly are, lie beside each
/// other in memory and share a look-up. NOT safe for one writer beside readers; many readers are
/// fine.
class BrickIndex {
 public:
  /// No number, no brick.
  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();

  /// The part of a voxel's place that one of its coordinates makes.
  struct Part {
    std::uint64_t brick_key = 0;
    std::uint32_t cell = 0;
  };
  [[nodiscard]] static constexpr Part part_x(int x) {
    return {packed_index(x >> 2, 0, 0), static_cast<std::uint32_t>(x & 3) << 3};
  }
  [[nodiscard]] static constexpr Part part_y(int y) {
    return {packed_index(0, y >> 2, 0), static_cast<std::uint32_t>(y & 3) << 1};
  }
  [[nodiscard]] static constexpr Part part_z(int z) {
    return {packed_index(0, 0, z >> 1), static_cast<std::uint32_t>(z & 1)};
  }
  /// A voxel's place: its brick, and its cell there.
  [[nodiscard]] static constexpr Part place(Part x, Part y, Part z) {
    return {x.brick_key | y.brick_key | z.brick_key, x.cell | y.cell | z.cell};
  }
  [[nodiscard]] static constexpr Part place(int x, int y, int z) {
    return place(part_x(x), part_y(y), part_z(z));
  }

  /// The brick of this key, or `none`. Bricks keep their position until they are erased.
  [[nodiscard]] std::uint32_t find_brick(std::uint64_t brick_key) const {
    const auto entry = bricks_by_key_.find(brick_key);
    return entry == bricks_by_key_.end() ? none : entry->second;
  }
  /// The brick of this key, made where there is none.
  [[nodiscard]] std::uint32_t brick_at(std::uint64_t brick_key);
  /// The number of a brick's voxel, or `none`.
  [[nodiscard]] std::uint32_t number(std::uint32_t brick, std::uint32_t cell) const {
    return bricks_[brick][cell];
  }
  [[nodiscard]] std::uint32_t& number(std::uint32_t brick, std::uint32_t cell) {
    return bricks_[brick][cell];
  }
  [[nodiscard]] std::uint32_t number(Part place) const {
    const std::uint32_t brick = find_brick(place.brick_key);
    return brick == none ? none : number(brick, place.cell);
  }

  /// Erases the voxels for whose number the predicate holds, and bricks without voxels. Looks only
  /// at bricks for which `is_looked_at(x, y, z)` holds, of their lowest voxel.
  template <typename BrickPredicate, typename Predicate>
  void erase_if(BrickPredicate is_looked_at, Predicate predicate);
  void clear();

  [[nodiscard]] std::size_t memory_bytes() const {
    using Entry = decltype(bricks_by_key_)::value_type;
    // A bucket holds its entry and its probe distance.
    return bricks_.capacity() * sizeof(Brick) + free_.capacity() * sizeof(std::uint32_t) +
           bricks_by_key_.bucket_count() * (sizeof(Entry) + sizeof(std::uint64_t));
  }

 private:
  using Brick = std::array<std::uint32_t, std::size_t{4} * 4 * 2>;

  tsl::robin_map<std::uint64_t, std::uint32_t, IndexHash> bricks_by_key_;
  std::vector<Brick> bricks_;
  std::vector<std::uint32_t> free_;
};

inline std::uint32_t BrickIndex::brick_at(std::uint64_t brick_key) {
  const auto [entry, is_new] = bricks_by_key_.try_emplace(brick_key, 0U);
  if (!is_new) return entry->second;
  if (free_.empty()) {
    // Less room ahead than vectors take by themselves: many maps have many of these.
    if (bricks_.size() == bricks_.capacity())
      bricks_.reserve(bricks_.size() + bricks_.size() / 8 + 8);
    free_.push_back(static_cast<std::uint32_t>(bricks_.size()));
    bricks_.emplace_back();
  }
  entry.value() = free_.back();
  free_.pop_back();
  bricks_[entry->second].fill(none);
  return entry->second;
}

template <typename BrickPredicate, typename Predicate>
void BrickIndex::erase_if(BrickPredicate is_looked_at, Predicate predicate) {
  for (auto entry = bricks_by_key_.begin(); entry != bricks_by_key_.end();) {
    const auto [x, y, z] = unpacked_index(entry->first);
    if (!is_looked_at(4 * x, 4 * y, 2 * z)) {
      ++entry;
      continue;
    }
    bool is_empty = true;
    for (std::uint32_t& number : bricks_[entry->second]) {
      if (number != none && predicate(number)) number = none;
      is_empty &= number == none;
    }
    if (!is_empty) {
      ++entry;
      continue;
    }
    free_.push_back(entry->second);
    entry = bricks_by_key_.erase(entry);
  }
}

inline void BrickIndex::clear() {
  bricks_by_key_.clear();
  bricks_.clear();
  free_.clear();
}

}  // namespace stillmap
