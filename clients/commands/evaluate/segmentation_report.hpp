#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "core/evaluation/confusion_matrix.hpp"

namespace stillmap::cli {

/// IoU of every class and of the coarse groups, for people and for programs.
[[nodiscard]] std::string describe(const evaluation::ConfusionMatrix& matrix);
[[nodiscard]] nlohmann::json to_json(const evaluation::ConfusionMatrix& matrix);

}  // namespace stillmap::cli
