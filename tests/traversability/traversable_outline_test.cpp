#include "core/traversability/occupancy_grid.hpp"

#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <random>

namespace stillmap {
namespace {

OccupancyGrid grid_of(std::uint32_t width, std::uint32_t height, std::int8_t value) {
  OccupancyGrid grid;
  grid.origin_map = {-10.0, 5.0};
  grid.resolution_m = 0.5;
  grid.width = width;
  grid.height = height;
  grid.data.assign(static_cast<std::size_t>(width) * height, value);
  return grid;
}

void set(OccupancyGrid& grid, std::uint32_t x0, std::uint32_t y0, std::uint32_t x1,
         std::uint32_t y1, std::int8_t value) {
  for (std::uint32_t y = y0; y < y1; ++y) {
    for (std::uint32_t x = x0; x < x1; ++x) grid.data[y * grid.width + x] = value;
  }
}

TEST(TraversableOutline, ASquareWithAHole) {
  OccupancyGrid grid = grid_of(20, 20, -1);
  set(grid, 2, 2, 18, 18, 0);
  set(grid, 8, 8, 11, 11, 100);
  const auto polygons = free_outlines(grid);
  ASSERT_EQ(polygons.size(), 1U);
  EXPECT_EQ(polygons[0].outer.size(), 4U);
  ASSERT_EQ(polygons[0].holes.size(), 1U);
  // 15 cells between the centres of the outermost ones; the hole grows to the cells around it.
  const double hole_m2 = 4.0 * 4.0 * 0.25;
  EXPECT_NEAR(area_m2(polygons[0]), 15.0 * 15.0 * 0.25 - hole_m2, 0.5);
  Eigen::AlignedBox2d bounds;
  for (const Eigen::Vector2d& corner : polygons[0].outer) bounds.extend(corner);
  EXPECT_EQ(bounds.min(), Eigen::Vector2d(-10.0 + 2.5 * 0.5, 5.0 + 2.5 * 0.5));
}

TEST(TraversableOutline, CellsOfTheSafetyMarginAreOutside) {
  OccupancyGrid grid = grid_of(20, 20, 0);
  set(grid, 10, 0, 20, 20, occupancy_inscribed);
  const auto polygons = free_outlines(grid);
  ASSERT_EQ(polygons.size(), 1U);
  for (const Eigen::Vector2d& corner : polygons[0].outer) EXPECT_LT(corner.x(), -5.0);
}

/// Draws the polygons back onto a grid.
cv::Mat1b drawn(const std::vector<TraversablePolygon>& polygons, const OccupancyGrid& grid) {
  cv::Mat1b image(static_cast<int>(grid.height), static_cast<int>(grid.width), std::uint8_t{0});
  const auto cells = [&](const TraversableRing& ring) {
    std::vector<cv::Point> points;
    for (const Eigen::Vector2d& p_map : ring) {
      const Eigen::Vector2d cell = (p_map - grid.origin_map) / grid.resolution_m;
      points.emplace_back(static_cast<int>(cell.x()), static_cast<int>(cell.y()));
    }
    return points;
  };
  for (const TraversablePolygon& polygon : polygons) {
    std::vector<std::vector<cv::Point>> rings{cells(polygon.outer)};
    for (const TraversableRing& hole : polygon.holes) rings.push_back(cells(hole));
    cv::fillPoly(image, rings, cv::Scalar(255));
  }
  return image;
}

TEST(TraversableOutline, NothingThatIsNotFreeIsInside) {
  std::mt19937 random(4);
  OccupancyGrid grid = grid_of(80, 60, 0);
  for (int i = 0; i < 40; ++i) {
    const auto below = [&](std::uint32_t end) {
      return static_cast<std::uint32_t>(random() % end);
    };
    const std::uint32_t x = below(76);
    const std::uint32_t y = below(56);
    set(grid, x, y, x + 1 + below(4), y + 1 + below(4), i % 2 == 0 ? 100 : -1);
  }
  const cv::Mat1b inside = drawn(free_outlines(grid, 0.0), grid);
  int missed = 0;
  for (int y = 0; y < inside.rows; ++y) {
    for (int x = 0; x < inside.cols; ++x) {
      const bool is_free =
          grid.at(static_cast<std::uint32_t>(x), static_cast<std::uint32_t>(y)) == 0;
      EXPECT_TRUE(is_free || inside(y, x) == 0) << x << ", " << y;
      if (is_free && inside(y, x) == 0) ++missed;
    }
  }
  EXPECT_LT(missed, 20);  // single cells in corners
}

TEST(TraversableOutline, TheLargestPieceComesFirstAndSpecksAreLeftOut) {
  OccupancyGrid grid = grid_of(40, 20, -1);
  set(grid, 1, 1, 4, 4, 0);
  set(grid, 10, 1, 30, 15, 0);
  set(grid, 35, 5, 36, 6, 0);
  const auto polygons = free_outlines(grid, 0.5);
  ASSERT_EQ(polygons.size(), 2U);
  EXPECT_GT(area_m2(polygons[0]), area_m2(polygons[1]));
}

TEST(TraversableOutline, OfNothingIsNothing) {
  EXPECT_TRUE(free_outlines(OccupancyGrid{}).empty());
  EXPECT_TRUE(free_outlines(grid_of(10, 10, 100)).empty());
}

}  // namespace
}  // namespace stillmap
