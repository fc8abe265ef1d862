#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "core/traversability/traversability_view.hpp"
#include "core/traversability/path_check.hpp"

namespace stillmap::cli {

/// Answers about paths and places, for programs and for people.
[[nodiscard]] nlohmann::json to_json(const PathCheck& check, const std::string& profile);
[[nodiscard]] std::string describe(const PathCheck& check, const std::string& profile);
[[nodiscard]] nlohmann::json to_json(const NearestTraversable& nearest, const std::string& profile);
[[nodiscard]] std::string describe(const NearestTraversable& nearest, const std::string& profile);

}  // namespace stillmap::cli
