#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "clients/doctor/host_facts.hpp"

namespace stillmap {

/// The segments and ports of Fast DDS in a folder of shared memory.
[[nodiscard]] std::vector<SharedSegment> shared_segments(const std::filesystem::path& folder);

/// Why nothing can be written there; empty when it can.
[[nodiscard]] std::string write_fault(const std::filesystem::path& folder);

}  // namespace stillmap
