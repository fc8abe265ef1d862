#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

namespace stillmap {

/// Depth to space along rows: phases that are stored side by side become rows of the image,
///   to(row phases + phase, i) = factor from(row, i / chunk, phase, i % chunk)
///                               + sum_factor to(row phases + phase, i),
/// the latter only with a sum_factor. oneDNN has only a slow reference implementation of it.
struct RowInterleaving {
  std::size_t rows = 0;
  std::size_t phases = 1;
  /// Contiguous values, and the number of such chunks in a row.
  std::size_t chunk = 0;
  std::size_t chunks = 0;
  float factor = 1.0F;
  std::optional<float> sum_factor;
};

/// Runs on OpenMP's threads, as oneDNN does. s8 values are rounded and saturated.
void interleave_rows(const RowInterleaving& how, const float* from, float* to);
void interleave_rows(const RowInterleaving& how, const std::int8_t* from, std::int8_t* to);

}  // namespace stillmap
