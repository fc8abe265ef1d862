#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "idl/interface/server_status.hpp"

namespace stillmap::cli {

/// The status for people: a few lines and the latencies as a table.
[[nodiscard]] std::string describe(const dds::ServerStatus& status);
[[nodiscard]] nlohmann::json to_json(const dds::ServerStatus& status);

}  // namespace stillmap::cli
