#include "core/segmentation/onednn/row_interleaving.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace stillmap {
namespace {

constexpr RowInterleaving layout{
    .rows = 3, .phases = 2, .chunk = 37, .chunks = 5, .factor = 0.7F, .sum_factor = 1.3F};
constexpr std::size_t size = layout.rows * layout.phases * layout.chunk * layout.chunks;

/// As the contract writes it, value by value.
std::vector<double> by_hand(const RowInterleaving& how, const auto& from, const auto& to) {
  std::vector<double> result;
  for (std::size_t row = 0; row < how.rows * how.phases; ++row) {
    for (std::size_t i = 0; i < how.chunk * how.chunks; ++i) {
      const std::size_t source =
          ((row / how.phases * how.chunks + i / how.chunk) * how.phases + row % how.phases) *
              how.chunk +
          i % how.chunk;
      const double sum =
          how.sum_factor ? double{*how.sum_factor} * static_cast<double>(to[result.size()]) : 0.0;
      result.push_back(double{how.factor} * static_cast<double>(from[source]) + sum);
    }
  }
  return result;
}

RowInterleaving without_sum() {
  RowInterleaving plain = layout;
  plain.sum_factor.reset();
  return plain;
}

TEST(RowInterleaving, PutsPhasesUnderEachOther) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> any(-3.0F, 3.0F);
  std::vector<float> from(size), to(size);
  std::ranges::generate(from, [&] { return any(random); });
  std::ranges::generate(to, [&] { return any(random); });
  for (const RowInterleaving& how : {layout, without_sum()}) {
    const std::vector<double> expected = by_hand(how, from, to);
    std::vector<float> result = to;
    interleave_rows(how, from.data(), result.data());
    for (std::size_t i = 0; i < size; ++i) EXPECT_NEAR(result[i], expected[i], 1e-5);
  }
}

TEST(RowInterleaving, RoundsAndCutsOffIntegers) {
  std::mt19937 random(2);
  std::uniform_int_distribution<int> any(-128, 127);
  std::vector<std::int8_t> from(size), to(size);
  std::ranges::generate(from, [&] { return static_cast<std::int8_t>(any(random)); });
  std::ranges::generate(to, [&] { return static_cast<std::int8_t>(any(random)); });
  for (const RowInterleaving& how : {layout, without_sum()}) {
    const std::vector<double> expected = by_hand(how, from, to);
    std::vector<std::int8_t> result = to;
    interleave_rows(how, from.data(), result.data());
    bool cut_off = false;
    for (std::size_t i = 0; i < size; ++i) {
      const double inside = std::clamp(expected[i], -128.0, 127.0);
      cut_off |= inside != expected[i];
      EXPECT_NEAR(result[i], inside, 0.5001);
    }
    EXPECT_EQ(cut_off, how.sum_factor.has_value());
  }
}

}  // namespace
}  // namespace stillmap
