#include "server/map_board.hpp"

#include <gtest/gtest.h>

namespace stillmap {
namespace {

std::vector<std::int64_t> stamps(const MapBoard& board) {
  std::vector<std::int64_t> out;
  for (const StampedPose& pose : board.trajectory()) out.push_back(pose.stamp_ns);
  return out;
}

void add(MapBoard& board, std::int64_t stamp_ns) {
  board.add_pose({.stamp_ns = stamp_ns}, OdometryHealth::good, "stream");
}

TEST(MapBoard, CollectsThePath) {
  MapBoard board;
  board.begin(std::make_shared<const MapView>(), {{.stamp_ns = 1}});
  add(board, 2);
  add(board, 3);
  EXPECT_EQ(stamps(board), (std::vector<std::int64_t>{1, 2, 3}));
  EXPECT_EQ(board.newest_pose().stamp_ns, 3);
  EXPECT_EQ(board.poses_added(), 2U);
  EXPECT_EQ(board.health(), OdometryHealth::good);
  EXPECT_EQ(board.label_source(), "stream");
}

TEST(MapBoard, LetsAReplayReplaceItsOldPath) {
  MapBoard board;
  board.begin(std::make_shared<const MapView>(),
              {{.stamp_ns = 1}, {.stamp_ns = 2}, {.stamp_ns = 3}});
  add(board, 2);
  EXPECT_EQ(stamps(board), (std::vector<std::int64_t>{1, 2}));
  add(board, 1);
  EXPECT_EQ(stamps(board), (std::vector<std::int64_t>{1}));
}

TEST(MapBoard, BeginsANewPathWithANewMap) {
  MapBoard board;
  board.begin(std::make_shared<const MapView>(MapView{.map_id = 1, .tiles = {}}), {});
  add(board, 1);
  board.begin(std::make_shared<const MapView>(MapView{.map_id = 2, .tiles = {}}), {});
  EXPECT_TRUE(stamps(board).empty());
  EXPECT_EQ(board.view()->map_id, 2U);
  EXPECT_EQ(board.newest_pose().stamp_ns, 0);
}

}  // namespace
}  // namespace stillmap
