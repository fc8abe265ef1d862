#pragma once

#include <cstdint>
#include <string>

namespace stillmap {

/// An octree in OctoMap's encoding: the data of a .bt or .ot file after its header, and of an
/// octomap_msgs/Octomap.
struct OctomapData {
  /// Occupied and free only (.bt), or every voxel's log-odds (.ot).
  bool binary = true;
  double resolution_m = 0.0;
  /// Empty for an empty map.
  std::string bytes;

  /// OctoMap's id of this tree type.
  static constexpr const char* tree_id = "OcTree";
};

/// Result of checking an encoding.
struct OctomapCheck {
  /// Inner nodes and leaves.
  std::uint64_t nodes = 0;
  /// What is damaged; empty when valid.
  std::string fault;
};

/// Parses the encoding without building an octree. OctoMap's reader trusts its input: on a damaged
/// stream it recurses without end.
[[nodiscard]] OctomapCheck check_octomap(const OctomapData& data);

}  // namespace stillmap
