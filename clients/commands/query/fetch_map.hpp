#pragma once

#include <chrono>

#include "clients/library/client.hpp"

namespace stillmap::cli {

/// The poses since the server's map began. Throws ServiceTimeout when there are none in time.
[[nodiscard]] Trajectory fetch_trajectory(Client& client, std::chrono::milliseconds timeout);

}  // namespace stillmap::cli
