#pragma once

#include <cstdint>
#include <string>

#include "core/occupancy/octomap_data.hpp"

namespace stillmap {

/// What encoded bytes hold, or what is wrong with them.
struct OctomapCheck {
  /// Inner nodes and leaves.
  std::uint64_t nodes = 0;
  /// In words; empty when all is well.
  std::string fault;
};

/// Walks through the encoding without building anything. OctoMap's own reader trusts its input: a
/// damaged stream makes it recurse without end.
[[nodiscard]] OctomapCheck check_octomap(const OctomapData& data);

}  // namespace stillmap
