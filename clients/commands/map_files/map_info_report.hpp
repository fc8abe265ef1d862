#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "core/map/tools/map_info.hpp"

namespace stillmap::cli {

[[nodiscard]] nlohmann::json to_json(const MapFileInfo& info);
/// The same for people, with a bar for the share of every class.
[[nodiscard]] std::string describe(const MapFileInfo& info);

}  // namespace stillmap::cli
