#pragma once

#include <numbers>

namespace stillmap {

/// Times an angle in degrees: in radians.
inline constexpr double rad_per_deg = std::numbers::pi / 180.0;
/// Times an angle in radians: in degrees.
inline constexpr double deg_per_rad = 180.0 / std::numbers::pi;

}  // namespace stillmap
