#pragma once

#include "core/lidar/scan.hpp"

namespace stillmap::cli {

/// A scan as large as those of an HDL-64E (64 x 1900 points), with walls and poles made up by a
/// formula: for timing, which does not depend on the scene.
[[nodiscard]] Scan benchmark_scan();

}  // namespace stillmap::cli
