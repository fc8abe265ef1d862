#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "core/traversability/traversability_map.hpp"
#include "core/traversability/traversability_query.hpp"

namespace stillmap::cli {

/// What there is to say of an area.
struct TraversabilityReport {
  TraversabilitySummary summary;
  /// Of a map file, whose area is computed from scratch.
  std::optional<TraversabilityUpdate> work;
  /// From the question to the answer.
  double milliseconds = 0.0;
};

/// `view` is of the answer.
[[nodiscard]] nlohmann::json to_json(const TraversabilityView& view,
                                     const TraversabilityReport& report);
[[nodiscard]] std::string describe(const TraversabilityView& view,
                                   const TraversabilityReport& report);

}  // namespace stillmap::cli
