#include "server/publishers/latest_map.hpp"

#include <gtest/gtest.h>

#include <thread>

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

std::shared_ptr<const MapView> view_of(std::uint64_t map_id, std::uint64_t version,
                                       const std::vector<TileId>& ids) {
  MapView view{.version = version, .map_id = map_id, .tiles = {}};
  for (const TileId id : ids) {
    Tile tile;
    tile.info.id = id;
    tile.info.revision = version;
    view.tiles.push_back(std::make_shared<const Tile>(std::move(tile)));
  }
  return std::make_shared<const MapView>(std::move(view));
}

TEST(MapBoard, KeepsTheHistoryThatEndsWithItsView) {
  MapBoard board;
  board.begin(view_of(1, 3, {{0, 0}}), {});
  EXPECT_EQ(board.state().history->known_since, 3U);
  const auto next = view_of(1, 4, {{0, 1}});
  board.show(next);
  const MapState state = board.state();
  EXPECT_EQ(state.view, next);
  EXPECT_EQ(state.history->version, 4U);
  ASSERT_EQ(state.history->gone.size(), 1U);
  EXPECT_EQ(state.history->gone.front(), (TileHistory::Event{{0, 0}, 4}));
  // The same view again changes nothing, not even the history.
  board.show(next);
  EXPECT_EQ(board.state().history, state.history);
  board.begin(view_of(2, 0, {}), {});
  EXPECT_TRUE(board.state().history->gone.empty());
}

TEST(MapBoard, ThinsALongPathEvenlyAndKeepsItsEnd) {
  MapBoard board;
  EXPECT_TRUE(board.trajectory(10).empty());
  for (std::int64_t k = 0; k < 100; ++k) {
    board.add_pose({k, Eigen::Isometry3d::Identity()}, OdometryHealth::good, "none");
  }
  EXPECT_EQ(board.trajectory(1000).size(), 100U);
  const Trajectory thin = board.trajectory(20);
  ASSERT_EQ(thin.size(), 14U);
  EXPECT_EQ(thin[1].stamp_ns, 8);
  EXPECT_EQ(thin[12].stamp_ns, 96);
  EXPECT_EQ(thin.back().stamp_ns, 99);
  EXPECT_LE(board.trajectory(2).size(), 2U);
}

TEST(MapBoard, WakesWhoWaitsForAnotherView) {
  using namespace std::chrono_literals;
  MapBoard board;
  EXPECT_FALSE(board.wait_for_news(nullptr, {}, 0ms));
  const auto first = std::make_shared<const MapView>();
  board.begin(first, {});
  EXPECT_EQ(board.wait_for_news(nullptr, {}, 0ms)->view, first);
  EXPECT_FALSE(board.wait_for_news(first, {}, 1ms));
  const auto second = std::make_shared<const MapView>();
  const std::jthread mapper([&] { board.show(second); });
  const auto news = board.wait_for_news(first, {}, 60s);
  ASSERT_TRUE(news);
  EXPECT_EQ(news->view, second);
  EXPECT_LE(news->shown, std::chrono::steady_clock::now());
}

TEST(MapBoard, LetsGoWhoWaitsWhenAStopIsRequested) {
  MapBoard board;
  std::stop_source stop;
  stop.request_stop();
  EXPECT_FALSE(board.wait_for_news(nullptr, stop.get_token(), std::chrono::seconds(60)));
}

}  // namespace
}  // namespace stillmap
