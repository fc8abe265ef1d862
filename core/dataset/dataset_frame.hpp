#pragma once

#include <cstdint>
#include <vector>

#include "core/lidar/scan.hpp"

namespace stillmap {

/// One scan of a recording and its truth.
struct DatasetFrame {
  /// With the labels reduced to the network's classes, where the recording has labels.
  Scan scan;
  /// Original SemanticKITTI labels: moving ids in the low, instances in the high 16 bits. Truth for
  /// evaluation only. Empty without labels.
  std::vector<std::uint32_t> raw_labels;
};

}  // namespace stillmap
