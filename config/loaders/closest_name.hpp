#pragma once

#include <span>
#include <string>
#include <string_view>

namespace stillmap {

/// The name that was probably meant: few letters apart, or the same but for a unit at the end
/// ("min_range" for "min_range_m"). Empty when nothing is near.
[[nodiscard]] std::string closest_name(std::string_view written,
                                       std::span<const std::string> known);

/// "; did you mean 'X'?" where there is such a name, else the list of all known names.
[[nodiscard]] std::string did_you_mean(std::string_view written,
                                       std::span<const std::string> known);

}  // namespace stillmap
