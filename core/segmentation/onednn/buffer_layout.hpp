#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "core/segmentation/onednn/execution_plan.hpp"

namespace stillmap {

/// Places in one block of memory.
struct BufferLayout {
  /// Byte at which each buffer begins, a multiple of `alignment`.
  std::vector<std::size_t> offset;
  std::size_t bytes = 0;

  static constexpr std::size_t alignment = 64;
};

/// Gives buffers that are needed at different times the same memory: the largest first, each as
/// low as it fits.
[[nodiscard]] BufferLayout lay_out(std::span<const Buffer> buffers);

}  // namespace stillmap
