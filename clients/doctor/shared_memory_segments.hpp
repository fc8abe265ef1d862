#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "clients/doctor/host_facts.hpp"

namespace stillmap::cli {

/// The segments and ports of Fast DDS in a folder of shared memory.
[[nodiscard]] std::vector<SharedMemorySegment> shared_memory_segments(
    const std::filesystem::path& folder);

/// Why nothing can be written there; empty when it can.
[[nodiscard]] std::string write_fault(const std::filesystem::path& folder);

}  // namespace stillmap::cli
