#pragma once

#include <array>

#include "core/traversability/traversability_query.hpp"
#include "core/traversability/traversability_view.hpp"

namespace stillmap {

/// How much of an area is in which state [cells].
struct TraversabilitySummary {
  std::uint64_t free = 0;
  /// Of the free ones.
  std::uint64_t inferred = 0;
  /// Unknown cells of the tiles, or of an answer's grid; most of them lie behind walls.
  std::uint64_t unknown = 0;
  /// By `BlockReason`.
  std::array<std::uint64_t, block_reason_count> lethal{};

  [[nodiscard]] std::uint64_t all_lethal() const;
};

[[nodiscard]] TraversabilitySummary summarize(const TraversabilityView& view);
/// Of an answer with a grid.
[[nodiscard]] TraversabilitySummary summarize(const TraversabilityAnswer& answer);

}  // namespace stillmap
