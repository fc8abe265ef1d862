#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace stillmap::dds {

/// A segment of Fast DDS in /dev/shm.
struct SharedMemorySegment {
  std::string name;
  std::uint64_t bytes = 0;
  std::uint32_t owner = 0;
  /// Since it was made: what is written to its memory does not count.
  std::chrono::seconds age{0};
  /// Nobody holds its lock: the process that made it is gone.
  bool is_stale = false;
};

/// The segments in a folder of shared memory.
[[nodiscard]] std::vector<SharedMemorySegment> shared_memory_segments(
    const std::filesystem::path& folder);

enum class StaleSegments {
  all,
  /// Those of messages. What lies at a port, half a MB, a living process may have open: once it is
  /// removed, that process does not reach who comes to have the port.
  without_ports
};

/// Removes the stale segments with their locks, where that is allowed; returns how many. One that
/// is younger than `min_age` may not have been locked yet.
int remove_stale_segments(const std::filesystem::path& folder, std::chrono::seconds min_age,
                          StaleSegments which = StaleSegments::all);

}  // namespace stillmap::dds
