#include "core/lidar/ranked_value.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <random>
#include <span>
#include <vector>

namespace stillmap {
namespace {

TEST(RankedValue, IsThatOfTheSortedValues) {
  std::mt19937 random(7);
  std::uniform_int_distribution<int> draw(0, 20);
  for (std::size_t size = 1; size < 40; ++size) {
    std::vector<int> values(size);
    std::ranges::generate(values, [&] { return draw(random); });
    std::vector<int> sorted = values;
    std::ranges::sort(sorted);
    for (std::size_t rank = 0; rank < size; ++rank)
      EXPECT_EQ(ranked_value(values, rank), sorted[rank]);
    EXPECT_EQ(median_of(values), sorted[size / 2]);
  }
}

TEST(RankedValue, LooksAtAPartOfAnArray) {
  std::array<float, 5> values{3.0F, 1.0F, 2.0F, -9.0F, -8.0F};
  EXPECT_EQ(median_of(std::span(values).first(3)), 2.0F);
  EXPECT_EQ(values[3], -9.0F);
}

}  // namespace
}  // namespace stillmap
