#include "core/traversability/distance_transform.hpp"

#include <gtest/gtest.h>

#include <random>

namespace stillmap {
namespace {

CellGrid<std::int32_t> by_brute_force(const CellGrid<std::uint8_t>& marked) {
  CellGrid<std::int32_t> squared(marked.width(), marked.height(), no_distance);
  for_each_cell(marked, [&](int x, int y) {
    for_each_cell(marked, [&](int mx, int my) {
      if (marked(mx, my) == 0) return;
      const std::int32_t d = (x - mx) * (x - mx) + (y - my) * (y - my);
      squared(x, y) = std::min(squared(x, y), d);
    });
  });
  return squared;
}

CellGrid<std::uint8_t> random_marks(int width, int height, double share, std::mt19937& random) {
  std::bernoulli_distribution is_marked(share);
  CellGrid<std::uint8_t> marked(width, height);
  for_each_cell(marked, [&](int x, int y) { marked(x, y) = is_marked(random) ? 1 : 0; });
  return marked;
}

TEST(DistanceTransform, EqualsBruteForceOnRandomGrids) {
  std::mt19937 random(7);
  for (const double share : {0.002, 0.02, 0.2, 0.9}) {
    for (const auto& [width, height] : {std::pair(41, 29), std::pair(7, 53), std::pair(64, 3)}) {
      const auto marked = random_marks(width, height, share, random);
      EXPECT_EQ(squared_distances(marked), by_brute_force(marked))
          << width << " x " << height << ", share " << share;
    }
  }
}

TEST(DistanceTransform, OneMarkInACorner) {
  CellGrid<std::uint8_t> marked(5, 4);
  marked(4, 3) = 1;
  const auto squared = squared_distances(marked);
  EXPECT_EQ(squared(0, 0), 25);
  EXPECT_EQ(squared(4, 3), 0);
}

TEST(DistanceTransform, NothingMarkedIsEndlesslyFar) {
  const auto squared = squared_distances(CellGrid<std::uint8_t>(3, 3));
  for (const std::int32_t d : squared.cells()) EXPECT_EQ(d, no_distance);
}

TEST(DistanceTransform, SingleRowsAndColumnsAndNothing) {
  std::mt19937 random(3);
  for (const auto& [width, height] : {std::pair(1, 30), std::pair(30, 1), std::pair(1, 1)}) {
    const auto marked = random_marks(width, height, 0.2, random);
    EXPECT_EQ(squared_distances(marked), by_brute_force(marked));
  }
  EXPECT_TRUE(squared_distances(CellGrid<std::uint8_t>(0, 0)).cells().empty());
}

}  // namespace
}  // namespace stillmap
