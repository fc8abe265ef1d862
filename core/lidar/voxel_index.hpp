#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace stillmap {

/// Indices of a voxel along x, y and z in one key of 21 bits each. Voxels less than 2^20 from the
/// origin have keys of their own.
[[nodiscard]] constexpr std::uint64_t packed_index(std::int64_t x, std::int64_t y, std::int64_t z) {
  constexpr std::uint64_t mask = (1U << 21) - 1;
  const auto part = [](std::int64_t index) { return static_cast<std::uint64_t>(index) & mask; };
  return part(x) << 42 | part(y) << 21 | part(z);
}

/// x, y and z of a packed index.
[[nodiscard]] constexpr std::array<int, 3> unpacked_index(std::uint64_t key) {
  // Shifts back and forth carry the sign.
  const auto part = [key](int shift) {
    return static_cast<int>(static_cast<std::int64_t>(key << (43 - shift)) >> 43);
  };
  return {part(42), part(21), part(0)};
}

/// Hash of packed indices for tables that use its low bits (finaliser of MurmurHash3): neighbours
/// land far apart, whichever bits of the key they differ in.
struct IndexHash {
  [[nodiscard]] constexpr std::size_t operator()(std::uint64_t key) const noexcept {
    key ^= key >> 33;
    key *= 0xff51afd7ed558ccdULL;
    return key ^ key >> 33;
  }
};

}  // namespace stillmap
