#pragma once

#include <chrono>

#include "clients/library/client.hpp"

namespace stillmap::cli {

/// The poses since the server's map began. Throws std::runtime_error with what the server
/// waits for when there are none after `timeout`; ServiceTimeout without a server.
[[nodiscard]] Trajectory fetch_trajectory(Client& client, std::chrono::milliseconds timeout);

}  // namespace stillmap::cli
