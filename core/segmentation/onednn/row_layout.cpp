#include "core/segmentation/onednn/row_layout.hpp"

#include <cmath>
#include <type_traits>

namespace stillmap {
namespace {

/// Rounded to the nearest without a call, so that the compiler makes vectors of it.
template <class T>
inline T stored(float value) {
  if constexpr (std::is_same_v<T, float>) {
    return value;
  } else {
    const float above = value > -128.0F ? value : -128.0F;
    const float inside = above < 127.0F ? above : 127.0F;
    return static_cast<T>(static_cast<std::int32_t>(inside + std::copysign(0.5F, inside)));
  }
}

template <class T>
void add_chunk(const RowLayout& layout, const T* __restrict from, T* __restrict to) {
  const float factor = layout.factor;
  const float sum_factor = *layout.sum_factor;
#pragma omp simd
  for (std::size_t i = 0; i < layout.chunk; ++i) {
    to[i] =
        stored<T>(factor * static_cast<float>(from[i]) + sum_factor * static_cast<float>(to[i]));
  }
}

template <class T>
void scale_chunk(const RowLayout& layout, const T* __restrict from, T* __restrict to) {
  const float factor = layout.factor;
#pragma omp simd
  for (std::size_t i = 0; i < layout.chunk; ++i) {
    to[i] = stored<T>(factor * static_cast<float>(from[i]));
  }
}

template <class T>
void lay_out(const RowLayout& layout, const T* from, T* to) {
  const std::size_t row_values = layout.chunk * layout.chunks;
  const auto rows = static_cast<std::ptrdiff_t>(layout.rows * layout.phases);
#pragma omp parallel for schedule(static)
  for (std::ptrdiff_t row = 0; row < rows; ++row) {
    const std::size_t place = static_cast<std::size_t>(row) / layout.phases;
    const std::size_t phase = static_cast<std::size_t>(row) % layout.phases;
    const T* source = from + (place * layout.chunks * layout.phases + phase) * layout.chunk;
    T* target = to + static_cast<std::size_t>(row) * row_values;
    for (std::size_t i = 0; i < layout.chunks; ++i) {
      if (layout.sum_factor) {
        add_chunk(layout, source, target);
      } else {
        scale_chunk(layout, source, target);
      }
      source += layout.phases * layout.chunk;
      target += layout.chunk;
    }
  }
}

}  // namespace

void lay_out_rows(const RowLayout& layout, const float* from, float* to) {
  lay_out(layout, from, to);
}

void lay_out_rows(const RowLayout& layout, const std::int8_t* from, std::int8_t* to) {
  lay_out(layout, from, to);
}

}  // namespace stillmap
