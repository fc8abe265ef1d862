#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "core/traversability/area_summary.hpp"
#include "core/traversability/traversability_map.hpp"

namespace stillmap {

/// What there is to say of an area.
struct TraversableReport {
  AreaSummary summary;
  TraversabilityUpdate work;
  /// For the whole map, all tiles from scratch.
  double milliseconds = 0.0;
};

[[nodiscard]] nlohmann::json to_json(const TraversabilityView& view,
                                     const TraversableReport& report);
[[nodiscard]] std::string describe(const TraversabilityView& view, const TraversableReport& report);

}  // namespace stillmap
