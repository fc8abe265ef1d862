#include "core/traversability/traversability_view.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>
#include <memory>
#include <numbers>
#include <random>
#include <set>
#include <span>
#include <utility>

#include "core/traversability/path_check.hpp"
#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::square_robot;
using test::traversability_of;
using test::VoxelWorld;
using ::testing::HasSubstr;

VoxelWorld road_with_a_house() {
  VoxelWorld world;
  world.ground(-10, -10, 10, 10, road);
  world.block(-3, -3, 3, 3, 0.3, 4.0, building);
  return world;
}

bool has_room(const TraversabilityView& view, const Eigen::Vector2d& p_map) {
  for (int i = 0; i < 16; ++i) {
    const PlanarPose pose{p_map, i * std::numbers::pi / 8};
    if (check_path(view, std::span(&pose, 1)).is_free) return true;
  }
  return false;
}

double by_brute_force(const TraversabilityView& view, const Eigen::Vector2d& p_map) {
  double best_m = std::numeric_limits<double>::infinity();
  CellLookup lookup(view);
  for (int y = -60; y < 60; ++y) {
    for (int x = -60; x < 60; ++x) {
      if (lookup.at({x, y}).cell.state != CellState::free) continue;
      const Eigen::Vector2d centre_map = view.centre_of({x, y});
      const double distance_m = (centre_map - p_map).norm();
      if (distance_m < best_m && has_room(view, centre_map)) best_m = distance_m;
    }
  }
  return best_m;
}

TEST(NearestTraversable, EqualsBruteForce) {
  const auto view = traversability_of(road_with_a_house().view(), square_robot());
  for (const Eigen::Vector2d& p_map : {Eigen::Vector2d(0, 0), Eigen::Vector2d(2.5, -1),
                                       Eigen::Vector2d(-11.5, 4), Eigen::Vector2d(7.03, 7.03)}) {
    const NearestTraversable nearest = nearest_traversable(*view, p_map);
    ASSERT_EQ(nearest.status, TraversabilityStatus::ok);
    EXPECT_DOUBLE_EQ(nearest.distance_m, by_brute_force(*view, p_map));
    EXPECT_NEAR((nearest.position_map - p_map).norm(), nearest.distance_m, 1e-12);
    EXPECT_EQ(nearest.cell.state, CellState::free);
    EXPECT_NEAR(nearest.height_m, 0.1, 1e-6);
  }
}

TEST(NearestTraversable, TheRobotCanStandThere) {
  // Its corners reach farther than its sides: free cells are not yet room.
  RobotProfile robot = square_robot();
  robot.length_m = 3.0;
  for (const UnknownGround unknown : {UnknownGround::blocked, UnknownGround::allowed}) {
    robot.unknown = unknown;
    const auto view = traversability_of(road_with_a_house().view(), robot);
    for (const Eigen::Vector2d& p_map :
         {Eigen::Vector2d(0, 0), Eigen::Vector2d(2.5, -1), Eigen::Vector2d(-11.9, 11.9)}) {
      const NearestTraversable nearest = nearest_traversable(*view, p_map);
      ASSERT_EQ(nearest.status, TraversabilityStatus::ok) << nearest.reason;
      EXPECT_TRUE(has_room(*view, nearest.position_map)) << nearest.position_map.transpose();
      EXPECT_GT(nearest.distance_m, 0.0);
    }
  }
}

/// Free cells, in rows with unknown ones between them up to `beyond_x` and side by side from there.
std::shared_ptr<const TraversabilityTile> striped_tile(TileId id, int side, int beyond_x) {
  auto tile = std::make_shared<TraversabilityTile>();
  auto surface = std::make_shared<SurfaceTile>();
  const auto cells = static_cast<std::size_t>(side) * static_cast<std::size_t>(side);
  tile->id = id;
  tile->side = surface->side = side;
  surface->cells.resize(cells);
  surface->begin.assign(cells + 1, 0);
  tile->cells.resize(cells);
  for (std::size_t i = 0; i < cells; ++i) {
    TraversabilityCell& cell = tile->cells[i];
    cell.clearance_m = 2.0F;
    if (id.x >= beyond_x || i / static_cast<std::size_t>(side) % 2 == 0)
      cell.state = CellState::free;
  }
  tile->surface = std::move(surface);
  return tile;
}

TEST(NearestTraversable, TriesTwentyThousandCellsAndNoMore) {
  // Five rows of five tiles of 4,050 free cells without room, then tiles that are free.
  TraversabilityView view;
  view.cell_m = 0.2;
  view.tile_size_m = 18.0;
  view.profile = square_robot();
  for (int x = 0; x < 6; ++x) {
    for (int y = 0; y < 5; ++y) view.tiles.push_back(striped_tile({x, y}, 90, 5));
  }
  const NearestTraversable far = nearest_traversable(view, {45.0, 45.0});
  EXPECT_EQ(far.status, TraversabilityStatus::not_found);
  EXPECT_THAT(far.reason, HasSubstr("20000 free cells"));
  // From nearer, fewer lie before them.
  const NearestTraversable near = nearest_traversable(view, {89.0, 45.0});
  EXPECT_EQ(near.status, TraversabilityStatus::ok) << near.reason;
  EXPECT_GT(near.position_map.x(), 90.0);
}

TEST(NearestTraversable, RespectsTheLongestWay) {
  const auto view = traversability_of(road_with_a_house().view(), square_robot());
  const NearestTraversable nearest = nearest_traversable(*view, {0, 0}, 2.0);
  EXPECT_EQ(nearest.status, TraversabilityStatus::not_found);
  EXPECT_THAT(nearest.reason, HasSubstr("within 2 m"));
}

TEST(NearestTraversable, HostilePlacesGetAStatusAndAReason) {
  const auto view = traversability_of(road_with_a_house().view(), square_robot());
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  using enum TraversabilityStatus;
  EXPECT_EQ(nearest_traversable(*view, {nan, 0}).status, invalid_request);
  EXPECT_EQ(nearest_traversable(*view, {0, nan}).status, invalid_request);
  EXPECT_EQ(nearest_traversable(*view, {-nan, nan}).status, invalid_request);
  EXPECT_EQ(nearest_traversable(*view, {0, 1e12}).status, invalid_request);
  EXPECT_EQ(nearest_traversable(*view, {0, 0}, nan).status, invalid_request);
  EXPECT_EQ(nearest_traversable(*view, {0, 0}, -1.0).status, invalid_request);
  EXPECT_EQ(nearest_traversable(*view, {9e4, 0}).status, not_found);
  EXPECT_EQ(nearest_traversable(*traversability_of(MapSnapshot{}, square_robot()), {0, 0}).status,
            not_found);
}

/// Whether a place lies in the footprint, or within `beyond_m` of its sides.
bool is_under(const RobotProfile& robot, const PlanarPose& pose, const Eigen::Vector2d& place_map,
              double beyond_m) {
  const Eigen::Vector2d p = Eigen::Rotation2Dd(-pose.heading_rad) * (place_map - pose.position_map);
  return std::abs(p.x() - robot.centre_ahead_m) <= 0.5 * robot.length_m + beyond_m &&
         std::abs(p.y()) <= 0.5 * robot.width_m + beyond_m;
}

TEST(VisitFootprint, VisitsTheCellsThatTheFootprintOverlapsAndNoOthers) {
  TraversabilityView view;
  view.cell_m = 0.2;
  view.profile = square_robot();
  view.profile.length_m = 1.7;
  view.profile.centre_ahead_m = 0.4;
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(0.0, 0.2);
  std::uniform_real_distribution<double> heading(-4.0, 4.0);
  for (int i = 0; i < 300; ++i) {
    const PlanarPose pose{{place(random), place(random)},
                          i % 3 == 0 ? std::numbers::pi / 4 : heading(random)};
    std::set<std::pair<int, int>> visited;
    visit_footprint(view, pose, [&](CellIndex cell) { visited.emplace(cell.x, cell.y); });
    for (int y = -15; y < 15; ++y) {
      for (int x = -15; x < 15; ++x) {
        bool is_overlapped = false;
        bool is_near = false;
        for (int k = 0; k < 21 * 21; ++k) {
          const Eigen::Vector2d p =
              view.cell_m * Eigen::Vector2d(x + k % 21 / 20.0, y + k / 21 / 20.0);
          is_overlapped = is_overlapped || is_under(view.profile, pose, p, -1e-6);
          is_near = is_near || is_under(view.profile, pose, p, 0.01);
        }
        const bool is_visited = visited.contains({x, y});
        ASSERT_TRUE(is_visited || !is_overlapped) << x << " " << y << ", " << pose.heading_rad;
        ASSERT_TRUE(!is_visited || is_near) << x << " " << y << ", " << pose.heading_rad;
      }
    }
  }
}

}  // namespace
}  // namespace stillmap
