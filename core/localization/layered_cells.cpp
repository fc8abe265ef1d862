#include "core/localization/layered_cells.hpp"

#include <algorithm>

namespace stillmap {

LayeredCells::Page& LayeredCells::page_at(int x, int y) {
  const auto [entry, is_new] =
      page_of_.try_emplace(key_of(x, y), static_cast<std::uint32_t>(pages_.size()));
  if (is_new) pages_.emplace_back().fill(0);
  return pages_[entry->second];
}

void LayeredCells::insert(const Eigen::Vector3f& position_map) {
  const Eigen::Vector3d p = position_map.cast<double>();
  std::uint8_t layers = 0;
  for (const double shift_m : {-config_.margin_m, 0.0, config_.margin_m})
    layers |= layer_bit(p.z() + shift_m, config_.layer_m);
  constexpr int mask = page_side - 1;
  for (int y = index(p.y() - config_.margin_m); y <= index(p.y() + config_.margin_m); ++y) {
    for (int x = index(p.x() - config_.margin_m); x <= index(p.x() + config_.margin_m); ++x)
      page_at(x, y)[static_cast<std::size_t>((y & mask) << page_shift | (x & mask))] |= layers;
  }
}

LayeredCells::Window LayeredCells::window(int first_x, int first_y, int width, int height) const {
  Window window{first_x, first_y, width, height, {}};
  window.cells.assign(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 0);
  constexpr int mask = page_side - 1;
  for (int page_y = first_y & ~mask; page_y < first_y + height; page_y += page_side) {
    for (int page_x = first_x & ~mask; page_x < first_x + width; page_x += page_side) {
      const auto entry = page_of_.find(key_of(page_x, page_y));
      if (entry == page_of_.end()) continue;
      const Page& page = pages_[entry->second];
      const int begin_x = std::max(page_x, first_x);
      const int end_x = std::min(page_x + page_side, first_x + width);
      for (int y = std::max(page_y, first_y); y < std::min(page_y + page_side, first_y + height);
           ++y) {
        const auto* const from = page.data() + ((y & mask) << page_shift | (begin_x & mask));
        std::copy(from, from + (end_x - begin_x),
                  window.cells.begin() +
                      (static_cast<std::ptrdiff_t>(y - first_y) * width + (begin_x - first_x)));
      }
    }
  }
  return window;
}

}  // namespace stillmap
