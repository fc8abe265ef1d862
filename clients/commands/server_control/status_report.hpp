#pragma once

#include <string>

#include "clients/terminal/json.hpp"
#include "idl/interface/server_status.hpp"

namespace stillmap::cli {

/// The status for people: a few lines and the latencies as a table.
[[nodiscard]] std::string status_text(const dds::ServerStatus& status);
[[nodiscard]] Json status_json(const dds::ServerStatus& status);

}  // namespace stillmap::cli
