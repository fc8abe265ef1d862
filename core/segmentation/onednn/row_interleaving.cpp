#include "core/segmentation/onednn/row_interleaving.hpp"

#include <cmath>
#include <type_traits>

namespace stillmap {
namespace {

/// Rounds to the nearest without a library call, so that the compiler can vectorise it.
template <class T>
inline T saturated(float value) {
  if constexpr (std::is_same_v<T, float>) {
    return value;
  } else {
    const float above = value > -128.0F ? value : -128.0F;
    const float inside = above < 127.0F ? above : 127.0F;
    return static_cast<T>(static_cast<std::int32_t>(inside + std::copysign(0.5F, inside)));
  }
}

template <class T>
void add_chunk(const RowInterleaving& how, const T* __restrict from, T* __restrict to) {
  const float factor = how.factor;
  const float sum_factor = *how.sum_factor;
#pragma omp simd
  for (std::size_t i = 0; i < how.chunk; ++i) {
    to[i] =
        saturated<T>(factor * static_cast<float>(from[i]) + sum_factor * static_cast<float>(to[i]));
  }
}

template <class T>
void scale_chunk(const RowInterleaving& how, const T* __restrict from, T* __restrict to) {
  const float factor = how.factor;
#pragma omp simd
  for (std::size_t i = 0; i < how.chunk; ++i) {
    to[i] = saturated<T>(factor * static_cast<float>(from[i]));
  }
}

template <class T>
void interleave(const RowInterleaving& how, const T* from, T* to) {
  const std::size_t row_values = how.chunk * how.chunks;
  const auto rows = static_cast<std::ptrdiff_t>(how.rows * how.phases);
#pragma omp parallel for schedule(static)
  for (std::ptrdiff_t row = 0; row < rows; ++row) {
    const std::size_t source_row = static_cast<std::size_t>(row) / how.phases;
    const std::size_t phase = static_cast<std::size_t>(row) % how.phases;
    const T* source = from + (source_row * how.chunks * how.phases + phase) * how.chunk;
    T* target = to + static_cast<std::size_t>(row) * row_values;
    for (std::size_t i = 0; i < how.chunks; ++i) {
      if (how.sum_factor) {
        add_chunk(how, source, target);
      } else {
        scale_chunk(how, source, target);
      }
      source += how.phases * how.chunk;
      target += how.chunk;
    }
  }
}

}  // namespace

void interleave_rows(const RowInterleaving& how, const float* from, float* to) {
  interleave(how, from, to);
}

void interleave_rows(const RowInterleaving& how, const std::int8_t* from, std::int8_t* to) {
  interleave(how, from, to);
}

}  // namespace stillmap
