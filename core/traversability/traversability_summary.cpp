#include "core/traversability/traversability_summary.hpp"

#include <numeric>

namespace stillmap {
namespace {

/// A cell of a tile or of an answer.
template <typename Cell>
void count(const Cell& cell, TraversabilitySummary& summary) {
  switch (cell.state) {
    case CellState::unknown:
      ++summary.unknown;
      break;
    case CellState::free:
      ++summary.free;
      if (cell.inferred) ++summary.inferred;
      break;
    case CellState::lethal:
      ++summary.lethal.at(static_cast<std::size_t>(cell.reason));
      break;
  }
}

}  // namespace

std::uint64_t TraversabilitySummary::all_lethal() const {
  return std::accumulate(lethal.begin(), lethal.end(), std::uint64_t{0});
}

TraversabilitySummary summarize(const TraversabilityView& view) {
  TraversabilitySummary summary;
  for (const auto& tile : view.tiles) {
    for (const TraversabilityCell& cell : tile->cells) count(cell, summary);
  }
  return summary;
}

TraversabilitySummary summarize(const TraversabilityAnswer& answer) {
  TraversabilitySummary summary;
  for (const TraversabilityCellInfo& cell : answer.cells) count(cell, summary);
  return summary;
}

}  // namespace stillmap
