#pragma once

#include <chrono>

#include "clients/library/client.hpp"

namespace stillmap {

/// The poses since the server's map began. Throws ServiceTimeout when there are none in time.
[[nodiscard]] Trajectory newest_path(Client& client, std::chrono::milliseconds timeout);

/// All tiles of the server's map, as they are now.
[[nodiscard]] MapView fetch_map(Client& client);

}  // namespace stillmap
