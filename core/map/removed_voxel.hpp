#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "core/lidar/semantic_class.hpp"

namespace stillmap {

/// Why a place that was hit is not in the planning view.
enum class RemovalReason : std::uint8_t {
  /// Only things that were seen moving were there.
  moving,
  /// Things that stood, but can move, were there.
  semi_static,
  /// It was shown, but rays keep passing through it.
  seen_through,
  /// It was shown, but later scans took it for something that can move.
  relabelled,
};
inline constexpr int removal_reason_count = 4;

/// A voxel that is kept out of the planning view, and why.
struct RemovedVoxel {
  Eigen::Vector3f position_map = Eigen::Vector3f::Zero();
  SemanticClass label = SemanticClass::unlabeled;
  RemovalReason reason = RemovalReason::moving;
  std::int64_t last_seen_ns = 0;
};

}  // namespace stillmap
