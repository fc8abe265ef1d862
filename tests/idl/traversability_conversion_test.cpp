#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "idl/conversions/occupancy_grid.hpp"
#include "idl/conversions/path_query.hpp"
#include "idl/conversions/traversability.hpp"

namespace stillmap::wire {
namespace {

using ::testing::HasSubstr;

TraversabilityAnswer two_cells() {
  TraversabilityAnswer answer;
  answer.grid.origin_map = {-1.4, 0.2};
  answer.grid.resolution_m = 0.2;
  answer.grid.width = 2;
  answer.grid.height = 1;
  answer.grid.data = {occupancy_unknown, occupancy_lethal};
  answer.grid.map_version = 7;
  answer.map_id = 8;
  answer.cells = {{},
                  {.state = CellState::lethal,
                   .reason = BlockReason::slope,
                   .inferred = true,
                   .ground_z_m = -0.25F}};
  answer.outlines = {{.outer = {{0, 0}, {3, 0}, {3, 3}}, .holes = {{{1, 1}, {1, 2}, {2, 2}}}},
                     {.outer = {{5, 5}, {6, 5}, {6, 6}}, .holes = {}}};
  return answer;
}

PathCheck blocked() {
  PathCheck check;
  check.conflict = {.segment = 3,
                    .along_m = 4.5,
                    .pose = {.position_map = {1.5, -2.5}, .heading_rad = 0.5},
                    .cell_centre_map = {2.1, -2.3},
                    .reason = BlockReason::unknown};
  check.clearance_m = 0.3;
  check.checked_m = 4.5;
  check.inferred_m = 1.25;
  check.map_version = 12;
  return check;
}

TEST(AreaConversion, KeepsTheQuery) {
  TraversabilityQuery query;
  query.profile = "delivery_robot";
  query.region = SphereRegion{.centre_map = {1.0, 2.0, 3.0}, .radius_m = 4.0};
  query.include_grid = false;
  query.include_outlines = true;
  query.max_cells = 5000;
  query.min_outline_area_m2 = 2.5;
  const TraversabilityQueryFromRequest back = from_request(to_request(query));
  ASSERT_TRUE(back.query) << back.fault;
  EXPECT_EQ(back.query->profile, query.profile);
  EXPECT_EQ(std::get<SphereRegion>(back.query->region).radius_m, 4.0);
  EXPECT_FALSE(back.query->include_grid);
  EXPECT_TRUE(back.query->include_outlines);
  EXPECT_EQ(back.query->max_cells, 5000U);
  EXPECT_EQ(back.query->min_outline_area_m2, 2.5);
}

TEST(AreaConversion, NobodyGetsMoreCellsThanAnAnswerBrings) {
  auto request = to_request(TraversabilityQuery{});
  EXPECT_EQ(request.max_cells(), max_answered_cells);
  for (const std::uint32_t asked : {0U, 4'000'000'000U}) {
    request.max_cells(asked);
    EXPECT_EQ(from_request(request).query->max_cells, max_answered_cells);
  }
  request.region().kind(9);
  EXPECT_THAT(from_request(request).fault, HasSubstr("region.kind is 9"));
}

TEST(AreaConversion, KeepsTheAnswer) {
  const TraversabilityAnswer answer = two_cells();
  const auto back = from_response(to_response(answer));
  ASSERT_TRUE(back);
  EXPECT_EQ(back->grid.status, TraversabilityStatus::ok);
  EXPECT_EQ(back->grid.origin_map, answer.grid.origin_map);
  EXPECT_EQ(back->grid.resolution_m, 0.2);
  EXPECT_EQ(back->grid.width, 2U);
  EXPECT_EQ(back->grid.height, 1U);
  EXPECT_EQ(back->grid.data, answer.grid.data);
  EXPECT_EQ(back->grid.map_version, 7U);
  EXPECT_EQ(back->map_id, 8U);
  ASSERT_EQ(back->cells.size(), 2U);
  EXPECT_EQ(back->cells[0].state, CellState::unknown);
  EXPECT_TRUE(std::isnan(back->cells[0].ground_z_m));
  EXPECT_EQ(back->cells[1].state, CellState::lethal);
  EXPECT_EQ(back->cells[1].reason, BlockReason::slope);
  EXPECT_TRUE(back->cells[1].inferred);
  EXPECT_EQ(back->cells[1].ground_z_m, -0.25F);
  ASSERT_EQ(back->outlines.size(), 2U);
  EXPECT_EQ(back->outlines[0].outer, answer.outlines[0].outer);
  EXPECT_EQ(back->outlines[0].holes, answer.outlines[0].holes);
  EXPECT_EQ(back->outlines[1].outer, answer.outlines[1].outer);
}

TEST(AreaConversion, KeepsEveryStatusAndRefusesOthers) {
  for (const TraversabilityStatus status :
       {TraversabilityStatus::ok, TraversabilityStatus::invalid_request,
        TraversabilityStatus::too_large, TraversabilityStatus::not_found}) {
    TraversabilityAnswer answer;
    answer.grid.status = status;
    answer.grid.reason = "why";
    const auto back = from_response(to_response(answer));
    ASSERT_TRUE(back);
    EXPECT_EQ(back->grid.status, status);
    EXPECT_EQ(back->grid.reason, "why");
  }
  auto response = to_response(two_cells());
  for (const std::uint8_t code : std::array<std::uint8_t, 5>{2, 3, 4, 7, 255}) {
    response.status().code(code);
    EXPECT_FALSE(from_response(response)) << int{code};
  }
}

TEST(AreaConversion, RefusesArraysAndNumbersThatDoNotFit) {
  const auto damaged = [](const auto& damage) {
    auto response = to_response(two_cells());
    damage(response);
    return !from_response(response);
  };
  EXPECT_TRUE(damaged([](auto& r) { r.grid().cost().pop_back(); }));
  EXPECT_TRUE(damaged([](auto& r) { r.grid().state().pop_back(); }));
  EXPECT_TRUE(damaged([](auto& r) { r.grid().reason().clear(); }));
  EXPECT_TRUE(damaged([](auto& r) { r.grid().inferred().push_back(0); }));
  EXPECT_TRUE(damaged([](auto& r) { r.grid().ground_z().pop_back(); }));
  EXPECT_TRUE(damaged([](auto& r) { r.grid().width(4'000'000'000); }));
  EXPECT_TRUE(damaged([](auto& r) { r.grid().state()[0] = 3; }));
  EXPECT_TRUE(damaged([](auto& r) { r.grid().reason()[1] = 9; }));
  EXPECT_TRUE(damaged([](auto& r) { r.outlines()[0].outer().x().pop_back(); }));
  EXPECT_TRUE(damaged([](auto& r) { r.outlines()[0].holes()[0].y().pop_back(); }));
}

TEST(PathConversion, KeepsTheQuery) {
  const PathQuery query{
      .profile = "car", .positions_map = {{1, 2}, {3, -4}}, .headings_rad = {0.1, -0.2}};
  const PathQueryFromRequest back = from_request(to_request(query));
  ASSERT_TRUE(back.query) << back.fault;
  EXPECT_EQ(back.query->profile, "car");
  EXPECT_EQ(back.query->positions_map, query.positions_map);
  EXPECT_EQ(back.query->headings_rad, query.headings_rad);
  auto request = to_request(query);
  request.y().pop_back();
  EXPECT_THAT(from_request(request).fault, HasSubstr("x has 2 values and y has 1"));
}

TEST(PathConversion, KeepsTheConflict) {
  const PathCheck check = blocked();
  const auto response = to_response(check, 77);
  EXPECT_EQ(response.status().map_id(), 77U);
  const auto back = from_response(response);
  ASSERT_TRUE(back && back->conflict);
  EXPECT_FALSE(back->is_free);
  EXPECT_EQ(back->clearance_m, check.clearance_m);
  EXPECT_EQ(back->checked_m, check.checked_m);
  EXPECT_EQ(back->inferred_m, check.inferred_m);
  EXPECT_EQ(back->map_version, 12U);
  EXPECT_EQ(back->conflict->segment, 3U);
  EXPECT_EQ(back->conflict->along_m, 4.5);
  EXPECT_EQ(back->conflict->pose.position_map, check.conflict->pose.position_map);
  EXPECT_EQ(back->conflict->pose.heading_rad, 0.5);
  EXPECT_EQ(back->conflict->cell_centre_map, check.conflict->cell_centre_map);
  EXPECT_EQ(back->conflict->reason, BlockReason::unknown);
}

TEST(PathConversion, AFreeOrRefusedPathHasNoConflict) {
  PathCheck free;
  free.is_free = true;
  EXPECT_FALSE(from_response(to_response(free, 0))->conflict);
  PathCheck refused;
  refused.status = TraversabilityStatus::too_large;
  refused.reason = "long";
  const auto back = from_response(to_response(refused, 0));
  ASSERT_TRUE(back);
  EXPECT_FALSE(back->conflict);
  EXPECT_EQ(back->reason, "long");
  auto response = to_response(blocked(), 0);
  response.conflict_reason(block_reason_count);
  EXPECT_FALSE(from_response(response));
}

TEST(NearestConversion, KeepsTheAnswer) {
  NearestTraversable nearest;
  nearest.position_map = {1.5, -2.5};
  nearest.height_m = 0.75;
  nearest.distance_m = 3.0;
  nearest.cell = {.state = CellState::free, .inferred = true, .cost = 40, .clearance_m = 0.5F};
  nearest.map_version = 4;
  const auto back = from_response(to_response(nearest, 5));
  ASSERT_TRUE(back);
  EXPECT_EQ(back->position_map, nearest.position_map);
  EXPECT_EQ(back->height_m, 0.75);
  EXPECT_EQ(back->distance_m, 3.0);
  EXPECT_EQ(back->cell, nearest.cell);
  EXPECT_EQ(back->map_version, 4U);
  nearest.status = TraversabilityStatus::not_found;
  EXPECT_EQ(from_response(to_response(nearest, 5))->status, TraversabilityStatus::not_found);
}

TEST(OccupancyGridConversion, KeepsTheGridAsNav2ReadsIt) {
  const OccupancyGrid grid = two_cells().grid;
  const auto message = to_message(grid, 1'500'000'000, "map");
  EXPECT_EQ(message.header().frame_id(), "map");
  EXPECT_EQ(message.header().stamp().sec(), 1);
  EXPECT_EQ(message.info().map_load_time().nanosec(), 500'000'000U);
  EXPECT_FLOAT_EQ(message.info().resolution(), 0.2F);
  EXPECT_EQ(message.info().origin().position().x(), -1.4);
  EXPECT_EQ(message.info().origin().orientation().w(), 1.0);
  EXPECT_EQ(static_cast<std::int8_t>(message.data()[0]), -1);
  const auto back = from_message(message);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->data, grid.data);
  EXPECT_EQ(back->origin_map, grid.origin_map);
  EXPECT_EQ(back->resolution_m, 0.2);
  EXPECT_EQ(back->width, 2U);
}

TEST(OccupancyGridConversion, RefusesWhatIsNoGrid) {
  const auto message = to_message(two_cells().grid, 0, "map");
  auto wide = message;
  wide.info().width(3);
  EXPECT_FALSE(from_message(wide));
  auto value = message;
  value.data()[0] = 101;
  EXPECT_FALSE(from_message(value));
  auto rotated = message;
  rotated.info().origin().orientation().z(1.0);
  EXPECT_FALSE(from_message(rotated));
  auto nowhere = message;
  nowhere.info().origin().orientation().w(0.0);
  EXPECT_FALSE(from_message(nowhere));
  EXPECT_TRUE(from_message(to_message(OccupancyGrid(), 0, "map")));
}

}  // namespace
}  // namespace stillmap::wire
