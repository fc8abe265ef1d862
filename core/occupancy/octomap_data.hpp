#pragma once

#include <cstdint>
#include <string>

namespace stillmap {

/// OctoMap's encodings.
enum class OctomapEncoding : std::uint8_t {
  /// Occupied and free only (.bt).
  binary,
  /// Every voxel's log-odds (.ot).
  full,
};

/// An octree in one of OctoMap's encodings: the data of a .bt or .ot file after its header, and of
/// an octomap_msgs/Octomap.
struct OctomapData {
  OctomapEncoding encoding = OctomapEncoding::binary;
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
