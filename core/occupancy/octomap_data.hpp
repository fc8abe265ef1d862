#pragma once

#include <cstdint>
#include <string>

namespace stillmap {

/// An octree as OctoMap encodes it: what stands behind the header of a .bt or .ot file, and in an
/// octomap_msgs/Octomap.
struct OctomapData {
  /// Occupied and free only (.bt), else every voxel's log-odds (.ot).
  bool binary = true;
  double resolution_m = 0.0;
  /// Empty for an empty map.
  std::string bytes;

  /// OctoMap's name of this kind of tree.
  static constexpr const char* tree_id = "OcTree";
};

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
