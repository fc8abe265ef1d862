#pragma once

#include <string>

#include "core/map/throttle_callback.hpp"
#include "core/occupancy/octomap_data.hpp"

namespace octomap {
class OcTree;
}

namespace stillmap {

/// The octree as OctoMap's writeData() writes it, or, binary, writeBinaryData() after
/// toMaxLikelihood() and prune(). `pause` is called about every millisecond: meanwhile the octree
/// may be changed. What is written is an octree whatever changes, each of its parts as it was at
/// some moment of the call.
[[nodiscard]] std::string encode_octree(const octomap::OcTree& octree, OctomapEncoding encoding,
                                        const ThrottleCallback& pause = {});

}  // namespace stillmap
