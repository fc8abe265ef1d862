#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

namespace stillmap {

/// Puts what stands side by side, `phases` rows of `length` values for each of `rows` places, one
/// under the other:
///   to(row phases + phase, i) = factor from(row, i / chunk, phase, i % chunk)
///                               + sum_factor to(...), the latter only if there is one.
/// oneDNN can only do it by its slow reference code.
struct RowLayout {
  std::size_t rows = 0;
  std::size_t phases = 1;
  /// Values of a row that stay together, and how many such pieces a row has.
  std::size_t chunk = 0;
  std::size_t chunks = 0;
  float factor = 1.0F;
  std::optional<float> sum_factor;
};

/// Runs on OpenMP's threads, as oneDNN does. Values of s8 are rounded and cut off at -128 and 127.
void lay_out_rows(const RowLayout& layout, const float* from, float* to);
void lay_out_rows(const RowLayout& layout, const std::int8_t* from, std::int8_t* to);

}  // namespace stillmap
