#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "core/traversability/traversability_query.hpp"

namespace stillmap::cli {

/// Outlines in GeoJSON's form: a polygon with holes a feature, its area in its properties.
/// Coordinates are metres in the map frame, not degrees.
[[nodiscard]] nlohmann::json to_json(const TraversabilityAnswer& answer,
                                     const std::string& profile);

/// Throws std::runtime_error naming the file when it cannot be written.
void write_outlines(const std::string& file, const TraversabilityAnswer& answer,
                    const std::string& profile);

}  // namespace stillmap::cli
