#include "core/traversability/cell_grid.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace stillmap {
namespace {

constexpr double max_distance = 100.0;

double by_brute_force(const CellGrid<std::uint8_t>& marked, int x, int y) {
  double nearest = max_distance;
  for_each_cell(marked, [&](int mx, int my) {
    if (marked(mx, my) != 0) nearest = std::min(nearest, std::hypot(x - mx, y - my));
  });
  return nearest;
}

void expect_brute_force(const CellGrid<std::uint8_t>& marked) {
  const CellGrid<float> distances = distances_to_marked(marked, max_distance);
  ASSERT_EQ(distances.width(), marked.width());
  ASSERT_EQ(distances.height(), marked.height());
  for_each_cell(marked, [&](int x, int y) {
    ASSERT_FLOAT_EQ(distances(x, y), static_cast<float>(by_brute_force(marked, x, y)))
        << x << ", " << y << " of " << marked.width() << " x " << marked.height();
  });
}

CellGrid<std::uint8_t> random_marks(int width, int height, double share, std::mt19937& random) {
  std::bernoulli_distribution is_marked(share);
  CellGrid<std::uint8_t> marked(width, height);
  for_each_cell(marked, [&](int x, int y) { marked(x, y) = is_marked(random) ? 1 : 0; });
  return marked;
}

TEST(DistancesToMarked, EqualBruteForceOnRandomGrids) {
  std::mt19937 random(7);
  for (const double share : {0.002, 0.02, 0.2, 0.9}) {
    for (const auto& [width, height] : {std::pair(41, 29), std::pair(7, 53), std::pair(64, 3)}) {
      expect_brute_force(random_marks(width, height, share, random));
    }
  }
}

TEST(DistancesToMarked, EqualBruteForceOnTilesWithTheirMargins) {
  std::mt19937 random(11);
  // Tiles of 100 cells with 10 and 50 more on every side.
  expect_brute_force(random_marks(120, 120, 0.001, random));
  expect_brute_force(random_marks(200, 200, 0.0005, random));
}

/// A grid wider than what OpenCV computes exactly; marks far apart, also in the same row.
TEST(DistancesToMarked, StayExactInVeryWideGrids) {
  CellGrid<std::uint8_t> marked(20'000, 12);
  std::mt19937 random(5);
  std::uniform_int_distribution<int> column(0, marked.width() - 1);
  std::uniform_int_distribution<int> row(0, marked.height() - 1);
  for (int i = 0; i < 400; ++i) marked(column(random), row(random)) = 1;
  const CellGrid<float> distances = distances_to_marked(marked, max_distance);
  for_each_cell(marked, [&](int x, int y) {
    double nearest = max_distance;
    for (int mx = std::max(0, x - 100); mx < std::min(x + 101, marked.width()); ++mx) {
      for (int my = 0; my < marked.height(); ++my) {
        if (marked(mx, my) != 0) nearest = std::min(nearest, std::hypot(x - mx, y - my));
      }
    }
    ASSERT_FLOAT_EQ(distances(x, y), static_cast<float>(nearest)) << x << ", " << y;
  });
}

/// Taller than OpenCV's table of squares reaches.
TEST(DistancesToMarked, StayExactInVeryTallGrids) {
  CellGrid<std::uint8_t> marked(3, 70'000);
  for (const int row : {10, 23'000, 23'050, 69'990}) marked(row % 3, row) = 1;
  const CellGrid<float> distances = distances_to_marked(marked, max_distance);
  for_each_cell(marked, [&](int x, int y) {
    double nearest = max_distance;
    for (const int row : {10, 23'000, 23'050, 69'990}) {
      nearest = std::min(nearest, std::hypot(x - row % 3, y - row));
    }
    ASSERT_FLOAT_EQ(distances(x, y), static_cast<float>(nearest)) << x << ", " << y;
  });
}

TEST(DistancesToMarked, OfOneMarkInACorner) {
  CellGrid<std::uint8_t> marked(5, 4);
  marked(4, 3) = 200;
  const CellGrid<float> distances = distances_to_marked(marked, max_distance);
  EXPECT_EQ(distances(0, 0), 5.0F);
  EXPECT_EQ(distances(4, 3), 0.0F);
}

TEST(DistancesToMarked, AreTheLargestWhereNothingIsMarkedOrNear) {
  const CellGrid<float> empty = distances_to_marked(CellGrid<std::uint8_t>(3, 3), 7.5);
  for (const float distance : empty.cells()) EXPECT_EQ(distance, 7.5F);
  CellGrid<std::uint8_t> marked(30, 1);
  marked(0, 0) = 1;
  EXPECT_EQ(distances_to_marked(marked, 7.5)(7, 0), 7.0F);
  EXPECT_EQ(distances_to_marked(marked, 7.5)(8, 0), 7.5F);
}

TEST(DistancesToMarked, OfSingleRowsAndColumnsAndNothing) {
  std::mt19937 random(3);
  for (const auto& [width, height] : {std::pair(1, 30), std::pair(30, 1), std::pair(1, 1)}) {
    expect_brute_force(random_marks(width, height, 0.2, random));
  }
  EXPECT_TRUE(distances_to_marked(CellGrid<std::uint8_t>(0, 0), 1.0).cells().empty());
}

}  // namespace
}  // namespace stillmap
