#include "core/traversability/distance_transform.hpp"

#include <algorithm>
#include <vector>

namespace stillmap {
namespace {

/// Farther than any distance along a column.
constexpr std::int32_t far_away = 40'000;

/// First pass: distance to the nearest mark in the same column.
CellGrid<std::int32_t> distances_along_columns(const CellGrid<std::uint8_t>& marked) {
  CellGrid<std::int32_t> g(marked.width(), marked.height(), far_away);
  for_each_cell(marked, [&](int x, int y) {
    if (marked(x, y) != 0) {
      g(x, y) = 0;
    } else if (y > 0) {
      g(x, y) = std::min(far_away, g(x, y - 1) + 1);
    }
  });
  for (int y = marked.height() - 2; y >= 0; --y) {
    for (int x = 0; x < marked.width(); ++x) g(x, y) = std::min(g(x, y), g(x, y + 1) + 1);
  }
  return g;
}

/// Second pass along one row: the lower envelope of the parabolas (x - i)^2 + g(i)^2.
class RowEnvelope {
 public:
  RowEnvelope(const CellGrid<std::int32_t>& g, int y) : g_(g), y_(y) {
    for (int x = 0; x < g.width(); ++x) {
      if (g(x, y) < far_away) add(x);
    }
  }

  /// Writes the row; the envelope must not be empty.
  void write(CellGrid<std::int32_t>& squared) const {
    std::size_t part = parts_.size() - 1;
    for (int x = squared.width() - 1; x >= 0; --x) {
      while (parts_[part].from > x) --part;
      squared(x, y_) = static_cast<std::int32_t>(value(parts_[part].i, x));
    }
  }
  [[nodiscard]] bool empty() const { return parts_.empty(); }

 private:
  /// From column `from` on, the parabola of column `i` is the lowest.
  struct Part {
    int i;
    int from;
  };

  [[nodiscard]] std::int64_t value(int i, int x) const {
    const std::int64_t dx = x - i;
    const std::int64_t dy = g_(i, y_);
    return dx * dx + dy * dy;
  }
  /// Last column in which the parabola of i, i < u, is not above that of u.
  [[nodiscard]] std::int64_t last_of(int i, int u) const {
    const std::int64_t gi = g_(i, y_);
    const std::int64_t gu = g_(u, y_);
    const std::int64_t numerator =
        static_cast<std::int64_t>(u) * u - static_cast<std::int64_t>(i) * i + gu * gu - gi * gi;
    const std::int64_t denominator = 2 * (static_cast<std::int64_t>(u) - i);
    const std::int64_t quotient = numerator / denominator;
    return quotient - (numerator % denominator < 0 ? 1 : 0);
  }
  void add(int u) {
    while (!parts_.empty() &&
           value(parts_.back().i, parts_.back().from) > value(u, parts_.back().from)) {
      parts_.pop_back();
    }
    if (parts_.empty()) {
      parts_.push_back({u, 0});
      return;
    }
    const std::int64_t from = last_of(parts_.back().i, u) + 1;
    if (from < g_.width()) parts_.push_back({u, static_cast<int>(from)});
  }

  const CellGrid<std::int32_t>& g_;
  int y_;
  std::vector<Part> parts_;
};

}  // namespace

CellGrid<std::int32_t> squared_distances(const CellGrid<std::uint8_t>& marked) {
  const CellGrid<std::int32_t> g = distances_along_columns(marked);
  CellGrid<std::int32_t> squared(marked.width(), marked.height(), no_distance);
  for (int y = 0; y < marked.height(); ++y) {
    const RowEnvelope envelope(g, y);
    if (!envelope.empty()) envelope.write(squared);
  }
  return squared;
}

}  // namespace stillmap
