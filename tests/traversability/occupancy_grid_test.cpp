#include "core/traversability/occupancy_grid.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::square_robot;
using test::traversability_of;
using test::VoxelWorld;
using ::testing::HasSubstr;

std::shared_ptr<const TraversabilityView> area() {
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
  const OccupancyGrid grid = occupancy_grid(*area(), whole_map_region());
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
  const auto view = area();
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
  const OccupancyGrid grid = occupancy_grid(*area(), circle);
  EXPECT_EQ(grid.width, 30U);
  EXPECT_EQ(grid.at(0, 0), occupancy_unknown);
  EXPECT_EQ(grid.at(15, 5), 0);
}

TEST(OccupancyGrid, BoxesBeyondTheMapEndAtItsEdge) {
  EXPECT_EQ(occupancy_grid(*area(), {box(-1e9, -1e9, 1e9, 1e9), {}}).width, 80U);
}

TEST(OccupancyGrid, HostileBoxesGetAStatusAndAReason) {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  const auto status = [view = area()](const Eigen::AlignedBox2d& b) {
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
  EXPECT_EQ(occupancy_grid(*area(), whole_map_region(), 6400).status, TraversabilityStatus::ok);
  const OccupancyGrid grid = occupancy_grid(*area(), whole_map_region(), 6399);
  EXPECT_EQ(grid.status, TraversabilityStatus::too_large);
  EXPECT_THAT(grid.reason, HasSubstr("80 x 80 cells of 0.2 m; at most 6399"));
}

}  // namespace
}  // namespace stillmap
