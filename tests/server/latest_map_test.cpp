#include "server/publishers/latest_map.hpp"

#include <gtest/gtest.h>

#include <thread>

namespace stillmap::server {
namespace {

std::vector<std::int64_t> stamps(const LatestMap& latest_map) {
  std::vector<std::int64_t> out;
  for (const StampedPose& pose : latest_map.trajectory()) out.push_back(pose.stamp_ns);
  return out;
}

void add(LatestMap& latest_map, std::int64_t stamp_ns) {
  latest_map.add_pose({.stamp_ns = stamp_ns}, OdometryHealth::good, "stream");
}

TEST(LatestMap, CollectsThePath) {
  LatestMap latest_map;
  latest_map.begin(std::make_shared<const MapSnapshot>(), {{.stamp_ns = 1}});
  add(latest_map, 2);
  add(latest_map, 3);
  EXPECT_EQ(stamps(latest_map), (std::vector<std::int64_t>{1, 2, 3}));
  EXPECT_EQ(latest_map.newest_pose().stamp_ns, 3);
  EXPECT_EQ(latest_map.poses_added(), 2U);
  EXPECT_EQ(latest_map.health(), OdometryHealth::good);
  EXPECT_EQ(latest_map.label_source(), "stream");
}

TEST(LatestMap, KeepsThePathOfEarlierRunsWhateverTheClockSays) {
  LatestMap latest_map;
  latest_map.begin(std::make_shared<const MapSnapshot>(),
                   {{.stamp_ns = 10}, {.stamp_ns = 20}, {.stamp_ns = 30}});
  add(latest_map, 2);
  add(latest_map, 4);
  EXPECT_EQ(stamps(latest_map), (std::vector<std::int64_t>{10, 20, 30, 2, 4}));
}

TEST(LatestMap, TellsHowItCameToAScanOfTheLoadedPathOrToItsEnd) {
  const auto way = [](const SharedTrajectory& path, std::int64_t stamp_ns) {
    LatestMap latest_map;
    latest_map.begin(std::make_shared<const MapSnapshot>(), path);
    std::vector<std::int64_t> out;
    for (const StampedPose& pose : latest_map.way_in_loaded_path(stamp_ns))
      out.push_back(pose.stamp_ns);
    return out;
  };
  const SharedTrajectory path{{.stamp_ns = 10}, {.stamp_ns = 20}, {.stamp_ns = 30}};
  using Stamps = std::vector<std::int64_t>;
  EXPECT_EQ(way(path, 40), (Stamps{20, 30}));
  EXPECT_EQ(way(path, 30), (Stamps{10, 20}));
  EXPECT_EQ(way(path, 20), Stamps{}) << "one pose tells no motion";
  EXPECT_EQ(way({{.stamp_ns = 10}}, 40), Stamps{});
  EXPECT_EQ(way({}, 40), Stamps{});
}

TEST(LatestMap, KeepsThePathUntilTheClockWasSetBack) {
  LatestMap latest_map;
  latest_map.begin(std::make_shared<const MapSnapshot>(), {{.stamp_ns = 10}});
  const auto add_is_set_back = [&](std::int64_t stamp_ns, MapEntry entry = MapEntry::enters) {
    return latest_map.add_pose({.stamp_ns = stamp_ns}, OdometryHealth::good, "stream", entry);
  };
  EXPECT_FALSE(add_is_set_back(2)) << "another run's clock is not this one's";
  EXPECT_FALSE(add_is_set_back(4));
  EXPECT_TRUE(add_is_set_back(3));
  EXPECT_FALSE(add_is_set_back(5));
  EXPECT_TRUE(add_is_set_back(1));
  EXPECT_EQ(stamps(latest_map), (std::vector<std::int64_t>{10, 2, 4, 3, 5, 1}));
  // What waited before and after is denied.
  EXPECT_FALSE(add_is_set_back(7, MapEntry::waits));
  EXPECT_TRUE(add_is_set_back(6, MapEntry::waits));
  EXPECT_FALSE(add_is_set_back(8, MapEntry::stays_out_with_waiting));
  EXPECT_EQ(stamps(latest_map), (std::vector<std::int64_t>{10, 2, 4, 3, 5, 1}));
  EXPECT_FALSE(add_is_set_back(9));
}

TEST(LatestMap, TellsUntilWhenItWasSeenWhateverTheClockSays) {
  LatestMap latest_map;
  latest_map.begin(std::make_shared<const MapSnapshot>(), {});
  EXPECT_FALSE(latest_map.seen_until_ns());
  latest_map.begin(std::make_shared<const MapSnapshot>(), {{.stamp_ns = 30}, {.stamp_ns = 10}});
  add(latest_map, 20);
  EXPECT_EQ(latest_map.seen_until_ns(), 30);
  // Poses that are no part of the path left what was seen from them.
  const VoxelGrid grid(0.2, 20.0);
  Voxel voxel;
  voxel.point_count = 1;
  voxel.mean_map = grid.corner_map({0, 0}, voxel.index).cast<float>();
  voxel.first_seen_ns = 70;
  voxel.last_seen_ns = 90;
  auto view = std::make_shared<MapSnapshot>();
  view->tiles = TileTable({std::make_shared<const Tile>(
      make_tile({0, 0}, 1, std::span<const Voxel>(&voxel, 1), grid))});
  latest_map.publish(view);
  EXPECT_EQ(latest_map.seen_until_ns(), 90);
}

TEST(LatestMap, CorrectsThePosesOfThisSessionAlone) {
  LatestMap latest_map;
  latest_map.begin(std::make_shared<const MapSnapshot>(), {{.stamp_ns = 1}, {.stamp_ns = 50}});
  add(latest_map, 20);
  add(latest_map, 30);
  const MapCorrection correction(
      {{25, Eigen::Vector3d::Zero(), Eigen::Isometry3d(Eigen::Translation3d(1, 2, 3))}});
  const auto view = std::make_shared<const MapSnapshot>(MapSnapshot{.version = 7, .tiles = {}});
  latest_map.correct(correction, view);
  EXPECT_EQ(latest_map.view(), view);
  EXPECT_EQ(latest_map.corrections(), 1U);
  const SharedTrajectory path = latest_map.trajectory();
  ASSERT_EQ(path.size(), 4U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_TRUE(path[i].T_map_lidar.translation().isZero()) << i;
  EXPECT_EQ(path[3].T_map_lidar.translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(latest_map.newest_pose().T_map_lidar.translation(), Eigen::Vector3d(1, 2, 3));
}

TEST(LatestMap, CorrectsNoPoseOfBeforeTheClockWasSetBack) {
  LatestMap latest_map;
  latest_map.begin(std::make_shared<const MapSnapshot>(), {});
  for (const std::int64_t stamp_ns : {20, 30, 10, 25}) add(latest_map, stamp_ns);
  const MapCorrection correction(
      {{15, Eigen::Vector3d::Zero(), Eigen::Isometry3d(Eigen::Translation3d(1, 2, 3))}});
  latest_map.correct(correction, std::make_shared<const MapSnapshot>());
  const SharedTrajectory path = latest_map.trajectory();
  ASSERT_EQ(path.size(), 4U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_TRUE(path[i].T_map_lidar.translation().isZero()) << i;
  EXPECT_EQ(path[3].T_map_lidar.translation(), Eigen::Vector3d(1, 2, 3));
}

TEST(LatestMap, KeepsLostPosesOutOfThePath) {
  LatestMap latest_map;
  latest_map.begin(std::make_shared<const MapSnapshot>(), {{.stamp_ns = 1}, {.stamp_ns = 2}});
  latest_map.add_pose({.stamp_ns = 1}, OdometryHealth::lost, "stream");
  latest_map.add_pose({.stamp_ns = 3}, OdometryHealth::lost, "stream");
  EXPECT_EQ(stamps(latest_map), (std::vector<std::int64_t>{1, 2}));
  EXPECT_EQ(latest_map.health(), OdometryHealth::lost);
  EXPECT_EQ(latest_map.poses_added(), 2U);
  add(latest_map, 4);
  EXPECT_EQ(stamps(latest_map), (std::vector<std::int64_t>{1, 2, 4}));
}

TEST(LatestMap, KeepsPosesThatAreDeniedLaterOutOfThePath) {
  using enum MapEntry;
  LatestMap latest_map;
  latest_map.begin(std::make_shared<const MapSnapshot>(), {});
  const auto add_as = [&](std::int64_t stamp_ns, MapEntry entry) {
    latest_map.add_pose({.stamp_ns = stamp_ns}, OdometryHealth::degenerate, "none", entry);
  };
  add_as(1, enters);
  add_as(2, waits);
  add_as(3, stays_out);
  add_as(4, waits);
  add_as(5, enters_with_waiting);
  EXPECT_EQ(stamps(latest_map), (std::vector<std::int64_t>{1, 2, 3, 4, 5})) << "they were right";
  add_as(6, waits);
  add_as(7, waits);
  EXPECT_EQ(latest_map.newest_pose().stamp_ns, 7);
  add_as(8, stays_out_with_waiting);
  EXPECT_EQ(stamps(latest_map), (std::vector<std::int64_t>{1, 2, 3, 4, 5}));
  EXPECT_EQ(latest_map.newest_pose().stamp_ns, 8) << "as far as anybody knows";
  add_as(9, waits);
  add_as(10, enters);
  EXPECT_EQ(stamps(latest_map), (std::vector<std::int64_t>{1, 2, 3, 4, 5, 10}));
}

TEST(LatestMap, BeginsANewPathWithANewMap) {
  LatestMap latest_map;
  latest_map.begin(std::make_shared<const MapSnapshot>(MapSnapshot{.map_id = 1, .tiles = {}}), {});
  add(latest_map, 1);
  latest_map.begin(std::make_shared<const MapSnapshot>(MapSnapshot{.map_id = 2, .tiles = {}}), {});
  EXPECT_TRUE(stamps(latest_map).empty());
  EXPECT_EQ(latest_map.view()->map_id, 2U);
  EXPECT_EQ(latest_map.newest_pose().stamp_ns, 0);
}

std::shared_ptr<const MapSnapshot> view_of(std::uint64_t map_id, std::uint64_t version,
                                           const std::vector<TileId>& ids) {
  MapSnapshot view{.version = version, .map_id = map_id, .tiles = {}};
  for (const TileId id : ids) {
    Tile tile;
    tile.info.id = id;
    tile.info.revision = version;
    view.tiles.set(std::make_shared<const Tile>(std::move(tile)));
  }
  return std::make_shared<const MapSnapshot>(std::move(view));
}

TEST(LatestMap, KeepsTheHistoryThatEndsWithItsView) {
  LatestMap latest_map;
  latest_map.begin(view_of(1, 3, {{0, 0}}), {});
  EXPECT_EQ(latest_map.state().history->known_since, 3U);
  const auto next = view_of(1, 4, {{0, 1}});
  latest_map.publish(next);
  const MapState state = latest_map.state();
  EXPECT_EQ(state.view, next);
  EXPECT_EQ(state.history->version, 4U);
  ASSERT_EQ(state.history->removed.size(), 1U);
  EXPECT_EQ(state.history->removed.front(), (TileHistory::Event{{0, 0}, 4}));
  // The same view again changes nothing, not even the history.
  latest_map.publish(next);
  EXPECT_EQ(latest_map.state().history, state.history);
  latest_map.begin(view_of(2, 0, {}), {});
  EXPECT_TRUE(latest_map.state().history->removed.empty());
}

TEST(LatestMap, ThinsALongPathEvenlyAndKeepsItsEnd) {
  LatestMap latest_map;
  EXPECT_TRUE(latest_map.trajectory(10).empty());
  for (std::int64_t k = 0; k < 100; ++k) {
    latest_map.add_pose({k, Eigen::Isometry3d::Identity()}, OdometryHealth::good, "none");
  }
  EXPECT_EQ(latest_map.trajectory(1000).size(), 100U);
  const Trajectory thin = latest_map.trajectory(20);
  ASSERT_EQ(thin.size(), 14U);
  EXPECT_EQ(thin[1].stamp_ns, 8);
  EXPECT_EQ(thin[12].stamp_ns, 96);
  EXPECT_EQ(thin.back().stamp_ns, 99);
  EXPECT_LE(latest_map.trajectory(2).size(), 2U);
}

TEST(LatestMap, WakesWhoWaitsForAnotherView) {
  using namespace std::chrono_literals;
  LatestMap latest_map;
  EXPECT_FALSE(latest_map.wait_for_update(nullptr, {}, 0ms));
  const auto first = std::make_shared<const MapSnapshot>();
  latest_map.begin(first, {});
  EXPECT_EQ(latest_map.wait_for_update(nullptr, {}, 0ms)->view, first);
  EXPECT_FALSE(latest_map.wait_for_update(first, {}, 1ms));
  const auto second = std::make_shared<const MapSnapshot>();
  const std::jthread mapper([&] { latest_map.publish(second); });
  const auto map_update = latest_map.wait_for_update(first, {}, 60s);
  ASSERT_TRUE(map_update);
  EXPECT_EQ(map_update->view, second);
  EXPECT_LE(map_update->published_at, std::chrono::steady_clock::now());
}

TEST(LatestMap, LetsGoWhoWaitsWhenAStopIsRequested) {
  LatestMap latest_map;
  std::stop_source stop;
  stop.request_stop();
  EXPECT_FALSE(latest_map.wait_for_update(nullptr, stop.get_token(), std::chrono::hours(1)));
}

}  // namespace
}  // namespace stillmap::server
