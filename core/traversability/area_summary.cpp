#include "core/traversability/area_summary.hpp"

#include <numeric>

namespace stillmap {

std::uint64_t AreaSummary::all_lethal() const {
  return std::accumulate(lethal.begin(), lethal.end(), std::uint64_t{0});
}

AreaSummary summarize(const TraversabilityView& view) {
  AreaSummary summary;
  for (const auto& tile : view.tiles) {
    for (const TraversabilityCell& cell : tile->cells) {
      if (cell.state == CellState::unknown) {
        ++summary.unknown;
      } else if (cell.state == CellState::free) {
        ++summary.free;
        if (cell.inferred) ++summary.inferred;
      } else {
        ++summary.lethal.at(static_cast<std::size_t>(cell.reason));
      }
    }
  }
  return summary;
}

}  // namespace stillmap
