#include "core/traversability/occupancy_grid.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <opencv2/imgproc.hpp>
#include <random>

#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::square_robot;
using test::traversability_of;
using test::VoxelWorld;
using ::testing::HasSubstr;

std::shared_ptr<const TraversabilityView> area_with_parking() {
  VoxelWorld world;
  world.ground(-8, -8, 8, 6, road);
  world.ground(-8, 0, -4, 4, parking);
  world.block(0, 0, 2, 2, 0.3, 2.0, building);
  return traversability_of(world.view(), square_robot());
}

Eigen::AlignedBox2d box(double x0, double y0, double x1, double y1) {
  return {Eigen::Vector2d(x0, y0), Eigen::Vector2d(x1, y1)};
}

TEST(OccupancyGrid, HasNav2sValues) {
  const OccupancyGrid grid = occupancy_grid(*area_with_parking(), whole_map_region());
  ASSERT_EQ(grid.status, TraversabilityStatus::ok);
  EXPECT_EQ(grid.origin_map, Eigen::Vector2d(-8, -8));
  EXPECT_EQ(grid.width, 80U);
  EXPECT_EQ(grid.height, 80U);  // whole tiles
  EXPECT_EQ(grid.data.size(), 6400U);
  const auto at = [&](double x_m, double y_m) {
    return grid.at(static_cast<std::uint32_t>((x_m + 8) / 0.2),
                   static_cast<std::uint32_t>((y_m + 8) / 0.2));
  };
  EXPECT_EQ(at(1.1, 1.1), occupancy_lethal);
  EXPECT_EQ(at(2.3, 1.1), occupancy_inscribed);
  EXPECT_EQ(at(-6.1, 2.1), 20);
  EXPECT_EQ(at(-6.1, -6.1), 0);
  EXPECT_EQ(at(1.1, 7.1), occupancy_unknown);
}

TEST(OccupancyGrid, EveryCellIsTheViews) {
  const auto view = area_with_parking();
  const OccupancyGrid grid = occupancy_grid(*view, {box(-3.05, -1.2, 4.9, 3.3), {}});
  ASSERT_EQ(grid.status, TraversabilityStatus::ok);
  CellLookup lookup(*view);
  for (std::uint32_t y = 0; y < grid.height; ++y) {
    for (std::uint32_t x = 0; x < grid.width; ++x) {
      const Eigen::Vector2d p_map =
          grid.origin_map + grid.resolution_m * Eigen::Vector2d(x + 0.5, y + 0.5);
      const TraversabilityCell cell = lookup.at(*view->cell_of(p_map)).cell;
      EXPECT_EQ(grid.at(x, y), cell.state == CellState::unknown ? -1 : static_cast<int>(cell.cost));
    }
  }
  EXPECT_NEAR(grid.origin_map.x(), -3.2, 1e-9);
  EXPECT_EQ(grid.width, 41U);
}

TEST(OccupancyGrid, AnotherShapeThanABoxTakesCellsOut) {
  const TraversabilityRegion circle =
      traversability_region(SphereRegion{.centre_map = {0.0, 0.0, 99.0}, .radius_m = 3.0});
  const OccupancyGrid grid = occupancy_grid(*area_with_parking(), circle);
  EXPECT_EQ(grid.width, 30U);
  EXPECT_EQ(grid.at(0, 0), occupancy_unknown);
  EXPECT_EQ(grid.at(15, 5), 0);
}

TEST(OccupancyGrid, BoxesBeyondTheMapEndAtItsEdge) {
  EXPECT_EQ(occupancy_grid(*area_with_parking(), {box(-1e9, -1e9, 1e9, 1e9), {}}).width, 80U);
}

TEST(OccupancyGrid, HostileBoxesGetAStatusAndAReason) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const auto status = [view = area_with_parking()](const Eigen::AlignedBox2d& b) {
    const OccupancyGrid grid = occupancy_grid(*view, {b, {}});
    EXPECT_TRUE(grid.data.empty());
    EXPECT_NE(grid.reason, "");
    return grid.status;
  };
  EXPECT_EQ(status(box(nan, 0, 1, 1)), TraversabilityStatus::invalid_request);
  EXPECT_EQ(status(box(2, 0, 1, 1)), TraversabilityStatus::invalid_request);
  EXPECT_EQ(status(Eigen::AlignedBox2d()), TraversabilityStatus::invalid_request);
  EXPECT_EQ(status(box(500, 500, 501, 501)), TraversabilityStatus::not_found);
  EXPECT_EQ(
      occupancy_grid(*traversability_of(MapSnapshot{}, square_robot()), whole_map_region()).status,
      TraversabilityStatus::not_found);
}

TEST(OccupancyGrid, TwoFarTilesDoNotMakeAnEndlessGrid) {
  VoxelWorld world;
  world.ground(0, 0, 2, 2, road);
  world.ground(90'000, 90'000, 90'002, 90'002, road);
  const OccupancyGrid grid =
      occupancy_grid(*traversability_of(world.view(), square_robot()), whole_map_region());
  EXPECT_EQ(grid.status, TraversabilityStatus::too_large);
  EXPECT_THAT(grid.reason, HasSubstr("smaller box"));
}

TEST(OccupancyGrid, KeepsToTheCellsThatAreAllowed) {
  EXPECT_EQ(occupancy_grid(*area_with_parking(), whole_map_region(), 6400).status,
            TraversabilityStatus::ok);
  const OccupancyGrid grid = occupancy_grid(*area_with_parking(), whole_map_region(), 6399);
  EXPECT_EQ(grid.status, TraversabilityStatus::too_large);
  EXPECT_THAT(grid.reason, HasSubstr("80 x 80 cells of 0.2 m; at most 6399"));
}

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
