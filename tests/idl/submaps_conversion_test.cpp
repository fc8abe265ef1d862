#include <gtest/gtest.h>

#include <limits>

#include "idl/conversions/submaps.hpp"
#include "submaps.h"

namespace stillmap::wire {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

Eigen::Isometry3d pose(double x) {
  return Eigen::Translation3d(x, -3.5, 0.7) *
         Eigen::AngleAxisd(-2.0, Eigen::Vector3d(1, 2, 9).normalized());
}

SubmapsOfMap three_submaps() {
  SubmapsOfMap submaps{.map_id = 0xFFFF'FFFF'FFFF'0001,
                       .frame = "map",
                       .child_frame = "base_link",
                       .list = {.graph_revision = 4, .submaps = {}, .loops = {}}};
  for (int i = 0; i < 3; ++i)
    submaps.list.submaps.push_back({1'700'000'000'123'456'789 + i, 25.0 * i, pose(i)});
  submaps.list.loops.push_back({.from = 0,
                                .to = 2,
                                .T_from_to = pose(9),
                                .overlap = 0.7,
                                .upright_fit = 0.8,
                                .jump_m = 1.5});
  return submaps;
}

TEST(SubmapsOnTheWire, ComeBackAsTheyWere) {
  const SubmapsOfMap sent = three_submaps();
  const auto message = to_wire(sent);
  EXPECT_EQ(message.header().stamp().nanosec(), 123'456'791U) << "of the newest";
  const auto back = from_wire(message);
  ASSERT_TRUE(back);
  EXPECT_EQ(back->map_id, sent.map_id);
  EXPECT_EQ(back->frame, "map");
  EXPECT_EQ(back->child_frame, "base_link");
  EXPECT_EQ(back->list.graph_revision, 4U);
  ASSERT_EQ(back->list.submaps.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(back->list.submaps[i].stamp_ns, sent.list.submaps[i].stamp_ns);
    EXPECT_EQ(back->list.submaps[i].way_m, sent.list.submaps[i].way_m);
    EXPECT_TRUE(back->list.submaps[i].T_map_submap.isApprox(sent.list.submaps[i].T_map_submap));
  }
  ASSERT_EQ(back->list.loops.size(), 1U);
  const SubmapList::Loop& loop = back->list.loops.front();
  EXPECT_EQ(loop.from, 0U);
  EXPECT_EQ(loop.to, 2U);
  EXPECT_TRUE(loop.T_from_to.isApprox(pose(9)));
  EXPECT_EQ(loop.overlap, 0.7);
  EXPECT_EQ(loop.upright_fit, 0.8);
  EXPECT_EQ(loop.jump_m, 1.5);
}

TEST(SubmapsOnTheWire, AMapThatBeginsHasNone) {
  const auto back =
      from_wire(to_wire({.map_id = 3, .frame = "map", .child_frame = "", .list = {}}));
  ASSERT_TRUE(back);
  EXPECT_EQ(back->map_id, 3U);
  EXPECT_TRUE(back->list.submaps.empty());
}

TEST(SubmapsOnTheWire, WhatMakesNoSenseIsLeftAlone) {
  const auto refused = [](auto change) {
    auto message = to_wire(three_submaps());
    change(message);
    EXPECT_FALSE(from_wire(message));
  };
  refused([](auto& message) { message.format_version(1); });
  refused([](auto& message) { message.submaps()[1].pose().position().x(nan); });
  refused([](auto& message) { message.submaps()[1].pose().orientation() = {}; });
  refused([](auto& message) { message.submaps()[1].way_m(nan); });
  refused([](auto& message) { message.submaps()[1].stamp().nanosec(2'000'000'000); });
  refused([](auto& message) { message.loops()[0].to_submap(3); });
  refused([](auto& message) { message.loops()[0].from_submap(2); });
  refused([](auto& message) { message.loops()[0].pose().position().z(nan); });
  refused([](auto& message) { message.loops()[0].overlap(nan); });
}

}  // namespace
}  // namespace stillmap::wire
