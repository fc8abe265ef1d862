#include "core/segmentation/onednn/buffer_layout.hpp"

#include <algorithm>
#include <numeric>

namespace stillmap {
namespace {

std::size_t aligned(std::size_t bytes) {
  return (bytes + BufferLayout::alignment - 1) / BufferLayout::alignment * BufferLayout::alignment;
}

bool at_one_time(const Buffer& a, const Buffer& b) {
  return a.first_step <= b.last_step && b.first_step <= a.last_step;
}

}  // namespace

BufferLayout lay_out(std::span<const Buffer> buffers) {
  std::vector<std::size_t> by_size(buffers.size());
  std::iota(by_size.begin(), by_size.end(), std::size_t{0});
  std::ranges::stable_sort(by_size, std::ranges::greater(),
                           [&](std::size_t i) { return buffers[i].bytes; });
  BufferLayout layout{.offset = std::vector<std::size_t>(buffers.size(), 0)};
  // Placed buffers from the lowest to the highest.
  std::vector<std::size_t> placed;
  for (const std::size_t i : by_size) {
    std::size_t& offset = layout.offset[i];
    for (const std::size_t other : placed) {
      if (!at_one_time(buffers[i], buffers[other])) continue;
      if (offset + aligned(buffers[i].bytes) <= layout.offset[other]) break;
      offset = std::max(offset, layout.offset[other] + aligned(buffers[other].bytes));
    }
    const auto above = std::ranges::upper_bound(
        placed, offset, {}, [&](std::size_t other) { return layout.offset[other]; });
    placed.insert(above, i);
    layout.bytes = std::max(layout.bytes, offset + aligned(buffers[i].bytes));
  }
  return layout;
}

}  // namespace stillmap
