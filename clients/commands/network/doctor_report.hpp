#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "clients/doctor/checks.hpp"

namespace stillmap::cli {

/// Who is there, and what is wrong: for people. `endpoints`: every reader and writer, too.
[[nodiscard]] std::string doctor_text(const SystemSnapshot& snapshot,
                                      const Diagnostics& diagnostics, bool endpoints);

/// The same with everything that was seen.
[[nodiscard]] nlohmann::json doctor_json(const SystemSnapshot& snapshot,
                                         const Diagnostics& diagnostics);

}  // namespace stillmap::cli
