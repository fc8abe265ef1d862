#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "core/map/tools/map_diff.hpp"

namespace stillmap::cli {

/// Everything but the single voxels.
[[nodiscard]] nlohmann::json to_json(const MapDiff& diff);
/// The same for people: of the tiles those with most changes.
[[nodiscard]] std::string describe(const MapDiff& diff);

}  // namespace stillmap::cli
