#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "core/traversability/traversability_summary.hpp"
#include "core/traversability/traversability_map.hpp"

namespace stillmap {

/// What there is to say of an area.
struct TraversableReport {
  AreaSummary summary;
  /// Of a map file, whose area is computed from scratch.
  std::optional<TraversabilityUpdate> work;
  /// From the question to the answer.
  double milliseconds = 0.0;
};

/// `view` is of the answer.
[[nodiscard]] nlohmann::json to_json(const TraversabilityView& view,
                                     const TraversableReport& report);
[[nodiscard]] std::string describe(const TraversabilityView& view, const TraversableReport& report);

}  // namespace stillmap
