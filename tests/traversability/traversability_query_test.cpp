#include "core/traversability/traversability_query.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "core/map/query/region.hpp"
#include "tests/numbers.hpp"
#include "tests/traversability/voxel_world.hpp"

namespace stillmap {
namespace {

using enum SemanticClass;
using test::square_robot;
using test::traversability_of;
using test::VoxelWorld;
using ::testing::HasSubstr;

using test::nan;

/// 16 m square with a house in it; (x, 7) was never seen.
std::shared_ptr<const TraversabilityView> area_with_house() {
  VoxelWorld world;
  world.ground(-8, -8, 8, 6, road);
  world.block(0, 0, 2, 2, 0.3, 2.0, building);
  return traversability_of(world.view(), square_robot());
}

TraversabilityQuery of(const Region& region) {
  TraversabilityQuery query;
  query.region = region;
  return query;
}

/// Many corners, so that the region is asked in parts.
PolygonRegion star() {
  PolygonRegion polygon{.corners_map = {}, .heights = {.min_m = 50.0, .max_m = 60.0}};
  constexpr int corners = 400;
  for (int i = 0; i < corners; ++i) {
    const double angle = 2.0 * M_PI * i / corners;
    const double radius_m = i % 2 == 0 ? 7.3 : 3.1;
    polygon.corners_map.emplace_back(radius_m * std::cos(angle), radius_m * std::sin(angle));
  }
  return polygon;
}

TEST(TraversabilityQuery, EveryCellOfARegionIsTheViewsAndNoOther) {
  const auto view = area_with_house();
  for (const Region& region :
       {Region(star()), Region(SphereRegion{.centre_map = {1, -2, 30}, .radius_m = 5.5}),
        Region(CorridorRegion{
            .path_map = {{-7, -7}, {0, 0}, {7, -5}}, .half_width_m = 1.3, .heights = {}})}) {
    const TraversabilityAnswer answer = query_traversability(*view, of(region));
    ASSERT_EQ(answer.grid.status, TraversabilityStatus::ok) << answer.grid.reason;
    const RegionShape shape(region);
    const double level_m = 0.5 * (shape.bounds_map().min().z() + shape.bounds_map().max().z());
    CellLookup lookup(*view);
    std::size_t inside = 0;
    for (std::size_t i = 0; i < answer.cells.size(); ++i) {
      const Eigen::Vector2d p_map =
          answer.grid.origin_map +
          0.2 * Eigen::Vector2d(static_cast<double>(i % answer.grid.width) + 0.5,
                                static_cast<double>(i / answer.grid.width) + 0.5);
      const bool is_inside =
          shape.contains({p_map.x(), p_map.y(), std::isfinite(level_m) ? level_m : 0.0});
      const auto found = lookup.at(*view->cell_of(p_map));
      const TraversabilityCell expected = is_inside ? found.cell : TraversabilityCell{};
      inside += is_inside ? 1 : 0;
      EXPECT_EQ(answer.cells[i].state, expected.state);
      EXPECT_EQ(answer.cells[i].reason, expected.reason);
      EXPECT_EQ(answer.cells[i].inferred, expected.inferred);
      const int value = expected.state == CellState::unknown ? -1 : expected.cost;
      EXPECT_EQ(answer.grid.data[i], value);
    }
    EXPECT_GT(inside, 100U);
    EXPECT_LT(inside, answer.cells.size());
  }
}

TEST(TraversabilityQuery, TellsTheGroundWhereItIsKnown) {
  const TraversabilityAnswer answer = query_traversability(*area_with_house(), {});
  const auto at = [&](double x_m, double y_m) {
    return answer.cells[static_cast<std::size_t>((y_m + 8) / 0.2) * answer.grid.width +
                        static_cast<std::size_t>((x_m + 8) / 0.2)];
  };
  EXPECT_NEAR(at(-5.1, -5.1).ground_z_m, 0.1, 0.1);
  EXPECT_TRUE(std::isnan(at(1.1, 7.1).ground_z_m));
  EXPECT_EQ(at(1.1, 1.1).reason, BlockReason::obstacle);
  EXPECT_EQ(at(2.3, 1.1).reason, BlockReason::inscribed);
  EXPECT_EQ(answer.grid.map_version, area_with_house()->version);
}

TEST(TraversabilityQuery, GivesOutlinesAloneWhenOnlyThoseAreWanted) {
  TraversabilityQuery query;
  query.include_grid = false;
  query.include_outlines = true;
  const TraversabilityAnswer answer = query_traversability(*area_with_house(), query);
  ASSERT_EQ(answer.outlines.size(), 1U);
  EXPECT_EQ(answer.outlines[0].holes.size(), 1U);
  EXPECT_TRUE(answer.grid.data.empty());
  EXPECT_TRUE(answer.cells.empty());
  query.min_outline_area_m2 = 1e4;
  EXPECT_TRUE(query_traversability(*area_with_house(), query).outlines.empty());
}

TEST(TraversabilityQuery, HostileQueriesGetAStatusAndAReason) {
  const auto expect = [view = area_with_house()](const TraversabilityQuery& query,
                                                 TraversabilityStatus status,
                                                 const std::string& named) {
    const TraversabilityAnswer answer = query_traversability(*view, query);
    EXPECT_EQ(answer.grid.status, status) << named;
    EXPECT_THAT(answer.grid.reason, HasSubstr(named));
    EXPECT_TRUE(answer.cells.empty());
  };
  expect(of(PolygonRegion{.corners_map = {{0, 0}, {9, 9}, {9, 0}, {0, 9}}, .heights = {}}),
         TraversabilityStatus::invalid_request, "polygon edges 0");
  expect(of(CorridorRegion{}), TraversabilityStatus::invalid_request, "corridor path has 0 points");
  expect(of(SphereRegion{.centre_map = {nan, 0, 0}, .radius_m = 1}),
         TraversabilityStatus::invalid_request, "sphere centre");
  BoxRegion box;
  box.box_map = {Eigen::Vector3d::Constant(-1e9), Eigen::Vector3d::Constant(1e9)};
  expect(of(box), TraversabilityStatus::invalid_request, "box x");
  expect(of(SphereRegion{.centre_map = {900, 0, 0}, .radius_m = 1}),
         TraversabilityStatus::not_found, "outside the map");
  TraversabilityQuery query;
  query.max_cells = 10;
  expect(query, TraversabilityStatus::too_large, "at most 10");
  query.max_cells = 0;
  expect(query, TraversabilityStatus::invalid_request, "max_cells is 0");
  query = {};
  query.include_grid = false;
  expect(query, TraversabilityStatus::invalid_request, "neither grid nor outlines");
  query = {};
  query.min_outline_area_m2 = nan;
  expect(query, TraversabilityStatus::invalid_request, "min_outline_area_m2");
}

TEST(TraversabilityAnswerView, AnswersAsTheAnswerThatItWasMadeFrom) {
  const TraversabilityAnswer answer = query_traversability(*area_with_house(), of(star()));
  const TraversabilityView view = view_of_answer(answer, square_robot());
  BoxRegion box;
  box.box_map.min().head<2>() = answer.grid.origin_map;
  box.box_map.max().head<2>() =
      answer.grid.origin_map + 0.2 * Eigen::Vector2d(answer.grid.width, answer.grid.height);
  const TraversabilityAnswer again = query_traversability(view, of(box));
  EXPECT_EQ(again.grid.data, answer.grid.data);
  EXPECT_EQ(again.grid.origin_map, answer.grid.origin_map);
  ASSERT_EQ(again.cells.size(), answer.cells.size());
  for (std::size_t i = 0; i < again.cells.size(); ++i) {
    EXPECT_EQ(again.cells[i].state, answer.cells[i].state);
    EXPECT_EQ(again.cells[i].reason, answer.cells[i].reason);
    EXPECT_EQ(again.cells[i].inferred, answer.cells[i].inferred);
  }
  EXPECT_EQ(summarize(answer, star()).free, summarize(view).free);
  EXPECT_EQ(summarize(answer, star()).lethal, summarize(view).lethal);
}

TEST(TraversabilitySummary, CountsTheRegionAndNotTheRectangleAboutIt) {
  const auto cells_of = [view = area_with_house()](const Region& region) {
    const TraversabilityAnswer answer = query_traversability(*view, of(region));
    const TraversabilitySummary summary = summarize(answer, region);
    return std::pair(summary.free + summary.all_lethal() + summary.unknown, answer.cells.size());
  };
  constexpr double cell_m2 = 0.2 * 0.2;
  const auto [circle, square] = cells_of(SphereRegion{.centre_map = {-2, -1, 0}, .radius_m = 5});
  EXPECT_NEAR(static_cast<double>(circle) * cell_m2, 25.0 * std::numbers::pi, 1.5);
  EXPECT_GT(static_cast<double>(square) * cell_m2, 99.0);
  const auto [corridor, about_it] =
      cells_of(CorridorRegion{.path_map = {{-6, -6}, {4, 4}}, .half_width_m = 0.5, .heights = {}});
  EXPECT_NEAR(static_cast<double>(corridor) * cell_m2, 14.1 + 0.25 * std::numbers::pi, 1.5);
  EXPECT_GT(about_it, 5 * corridor);
}

}  // namespace
}  // namespace stillmap
