#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <vector>

#include "core/lidar/prefetch.hpp"
#include "core/lidar/voxel_index.hpp"

namespace stillmap {

/// Finds entries of a list by their key: positions alone, four bytes a slot and some five to seven
/// an entry, by open addressing. The key is compared where the entry lies; eight bits of its hash
/// are in the slot, so that this is mostly done for the right entry.
class PositionIndex {
 public:
  static constexpr std::uint32_t none = std::numeric_limits<std::uint32_t>::max();
  /// Greatest number of entries.
  static constexpr std::size_t max_entries = (std::size_t{1} << 24) - 1;

  /// The position of the entry with this key, or `none`; `key_at(position)` tells an entry's key.
  template <typename KeyAt>
  [[nodiscard]] std::uint32_t find(std::uint32_t key, KeyAt key_at) const {
    if (slots_.empty()) return none;
    const std::uint64_t hash = IndexHash{}(key);
    for (std::size_t slot = first_slot(hash); slots_[slot] != 0; slot = next(slot)) {
      if (slots_[slot] >> 24 != tag(hash)) continue;
      const std::uint32_t position = (slots_[slot] & position_mask) - 1;
      if (key_at(position) == key) return position;
    }
    return none;
  }

  /// Where a key is looked for first.
  struct Start {
    std::size_t slot = 0;
    std::uint32_t tag = 0;
  };
  [[nodiscard]] Start start_of(std::uint32_t key) const {
    const std::uint64_t hash = IndexHash{}(key);
    return {first_slot(hash), tag(hash)};
  }
  /// Asks for the memory in which the key will be looked for.
  void prefetch_slot(const Start& start) const {
    if (!slots_.empty()) prefetch(&slots_[start.slot]);
  }
  /// The position that the key most likely has, or `none`: its entry is not looked at.
  [[nodiscard]] std::uint32_t likely_position(const Start& start) const {
    if (slots_.empty()) return none;
    for (std::size_t slot = start.slot; slots_[slot] != 0; slot = next(slot)) {
      if (slots_[slot] >> 24 == start.tag) return (slots_[slot] & position_mask) - 1;
    }
    return none;
  }

  /// Adds the entry at the end of the list, whose key is not in it yet.
  template <typename KeyAt>
  void push_back(std::uint32_t key, KeyAt key_at) {
    if ((size_ + 1) * 5 > slots_.size() * 4) rebuild(size_, size_ + size_ / 3 + 16, key_at);
    put(IndexHash{}(key), static_cast<std::uint32_t>(size_++));
  }

  /// Anew, for a list of `size` different keys and room for `expected`.
  template <typename KeyAt>
  void rebuild(std::size_t size, std::size_t expected, KeyAt key_at) {
    slots_ = std::vector<std::uint32_t>(expected + expected / 3 + 8);
    for (size_ = 0; size_ < size; ++size_) {
      const auto position = static_cast<std::uint32_t>(size_);
      put(IndexHash{}(key_at(position)), position);
    }
  }

  [[nodiscard]] std::size_t memory_bytes() const {
    return slots_.capacity() * sizeof(std::uint32_t);
  }

 private:
  static constexpr std::uint32_t position_mask = (1U << 24) - 1;

  [[nodiscard]] std::size_t first_slot(std::uint64_t hash) const {
    // The upper 32 bits choose the slot, the lowest eight are the tag.
    return static_cast<std::size_t>((hash >> 32) * slots_.size() >> 32);
  }
  [[nodiscard]] static std::uint32_t tag(std::uint64_t hash) {
    return static_cast<std::uint32_t>(hash & 0xFFU);
  }
  [[nodiscard]] std::size_t next(std::size_t slot) const {
    return slot + 1 == slots_.size() ? 0 : slot + 1;
  }
  void put(std::uint64_t hash, std::uint32_t position) {
    std::size_t slot = first_slot(hash);
    while (slots_[slot] != 0) slot = next(slot);
    slots_[slot] = tag(hash) << 24 | (position + 1);
  }

  /// Zero where nothing is, else a tag and the position plus one.
  std::vector<std::uint32_t> slots_;
  std::size_t size_ = 0;
};

}  // namespace stillmap
