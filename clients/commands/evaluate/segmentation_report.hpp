#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "core/evaluation/confusion_matrix.hpp"

namespace stillmap {

/// IoU of every class and of the coarse groups, for people and for programs.
[[nodiscard]] std::string describe(const ConfusionMatrix& matrix);
[[nodiscard]] nlohmann::json to_json(const ConfusionMatrix& matrix);

}  // namespace stillmap
