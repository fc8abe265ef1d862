#pragma once

#include "core/lidar/scan.hpp"

namespace stillmap {

/// A scan as large as those of an HDL-64E (64 x 1900 points), with walls and poles made up by a
/// formula: for timing, where what is seen does not matter.
[[nodiscard]] Scan speed_scan();

}  // namespace stillmap
