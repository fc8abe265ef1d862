#pragma once

#include <algorithm>
#include <cassert>
#include <cstddef>
#include <ranges>

namespace stillmap {

/// The value that `rank` others stand before in ascending order: 0 is the smallest. Takes time in
/// proportion to their number, and reorders them. There are more than `rank`, none of them NaN.
template <std::ranges::random_access_range Values>
[[nodiscard]] std::ranges::range_value_t<Values> ranked_value(Values&& values, std::size_t rank) {
  assert(rank < std::ranges::size(values));
  const auto ranked = std::ranges::begin(values) + static_cast<std::ptrdiff_t>(rank);
  std::ranges::nth_element(values, ranked);
  return *ranked;
}

/// The median of values that are not none, by `ranked_value`; of an even number the larger one of
/// the two in the middle.
template <std::ranges::random_access_range Values>
[[nodiscard]] std::ranges::range_value_t<Values> median_of(Values&& values) {
  return ranked_value(values, std::ranges::size(values) / 2);
}

}  // namespace stillmap
