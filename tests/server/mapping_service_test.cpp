#include <gmock/gmock.h>
#include <signal.h>

#include <map>
#include <mutex>

#include "core/map/storage/map_file.hpp"
#include "tests/server/room_scans.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

using ::testing::HasSubstr;

/// Tiles as a subscriber sees them.
struct TileMirror {
  std::mutex mutex;
  std::map<TileId, std::uint64_t> hashes;
  std::map<TileId, std::size_t> voxels;
};

class MappingService : public testing::Test {
 protected:
  MappingService() : setup_("every"), server_(setup_.server_arguments()), client_(setup_.client()) {
    client_.wait_for_server(patience);
  }

  void drive_scans(int count) {
    drive(publisher_, 0, count);
    ASSERT_TRUE(wait_for_scans(client_, static_cast<std::uint64_t>(count)));
  }

  ServiceSetup setup_;
  ServerProcess server_;
  Client client_;
  ScanPublisher publisher_{setup_.publisher(true)};
};

TEST_F(MappingService, SaysWhyNothingHappens) {
  const dds::ServerStatus status = client_.status();
  EXPECT_THAT(status.reason, HasSubstr("no scan received on rt/points yet"));
  EXPECT_EQ(status.delivery, DeliveryMode::every);
  EXPECT_EQ(status.label_source, "stream, else street");
  EXPECT_EQ(status.voxel_count, 0U);
  EXPECT_FALSE(status.software_version.empty());
}

TEST(MappingServiceOfAnyLidar, TellsWhichOneItsScansCameFrom) {
  const ServiceSetup setup("every", "save_period_s: 3600", "");
  ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  EXPECT_EQ(client.status().sensor, "not known yet");
  ScanPublisher publisher(setup.publisher(true));
  drive(publisher, 0, 6);
  ASSERT_TRUE(wait_for_scans(client, 6));
  EXPECT_EQ(client.status().sensor, "16 rings as seen in the data");
  EXPECT_EQ(client.status().dropped(), 0U);
  server.send(SIGTERM);
  ASSERT_EQ(server.wait_for_exit(patience), 0);
  const SavedMap stored = open_map_file(setup.map_file())->load();
  EXPECT_EQ(stored.metadata.at("sensor"), "16 rings as seen in the data");
  EXPECT_EQ(stored.trajectory.size(), 6U);
}

TEST_F(MappingService, GivesAPoseForEveryScan) {
  constexpr int scans = 15;
  std::mutex mutex;
  Trajectory poses;
  const auto subscription = client_.subscribe_odometry([&](const OdometryUpdate& update) {
    const std::scoped_lock lock(mutex);
    poses.push_back(update.pose);
  });
  drive_scans(scans);
  ASSERT_TRUE(eventually([&] {
    const std::scoped_lock lock(mutex);
    return poses.size() == scans;
  }));
  const Eigen::Isometry3d T_start = room_pose(0).T_map_lidar.inverse();
  for (int i = 0; i < scans; ++i) {
    const auto& pose = poses[static_cast<std::size_t>(i)];
    EXPECT_EQ(pose.stamp_ns, room_pose(i).stamp_ns);
    const Eigen::Isometry3d T_true = T_start * room_pose(i).T_map_lidar;
    EXPECT_LT((pose.T_map_lidar.translation() - T_true.translation()).norm(), 0.15) << i;
  }
  const dds::ServerStatus status = client_.status();
  EXPECT_EQ(status.counter("scans_received"), 15U);
  EXPECT_EQ(status.counter("scans_mapped"), 15U);
  EXPECT_EQ(status.dropped(), 0U);
  EXPECT_EQ(status.health, OdometryHealth::good);
  EXPECT_FALSE(status.latencies.empty());
}

TEST_F(MappingService, GivesALateJoinerEveryTileAndThePath) {
  drive_scans(10);
  Client late(setup_.client());
  TileMirror mirror;
  const auto tiles = late.subscribe_tiles([&](const dds::MapIdentity&, const Tile& tile) {
    const std::scoped_lock lock(mirror.mutex);
    mirror.hashes[tile.info.id] = tile.info.content_hash;
    mirror.voxels[tile.info.id] = tile.voxels.size();
  });
  TileMirror index;
  const auto infos = late.subscribe_tile_index([&](const dds::MapIdentity&, const TileInfo& info) {
    const std::scoped_lock lock(index.mutex);
    index.hashes[info.id] = info.content_hash;
  });
  std::mutex path_mutex;
  std::size_t path_poses = 0;
  const auto path = late.subscribe_path([&](const Trajectory& trajectory) {
    const std::scoped_lock lock(path_mutex);
    path_poses = trajectory.size();
  });

  TileVersions expected;
  EXPECT_TRUE(eventually([&] {
    expected = client_.get_tile_versions();
    std::map<TileId, std::uint64_t> hashes;
    for (const TileInfo& info : expected.tiles) hashes[info.id] = info.content_hash;
    const std::scoped_lock lock(mirror.mutex, index.mutex, path_mutex);
    return mirror.hashes == hashes && index.hashes == hashes && path_poses == 10;
  }));
  ASSERT_FALSE(expected.tiles.empty());
  for (const TileInfo& info : expected.tiles) {
    EXPECT_EQ(mirror.voxels[info.id], info.voxel_count);
  }
}

TEST_F(MappingService, ForgetsEverythingOnReset) {
  drive_scans(8);
  const std::uint64_t old_id = client_.get_tile_versions().map.map_id;
  const std::uint64_t new_id = client_.reset().map_id;
  EXPECT_NE(new_id, old_id);
  const TileVersions after = client_.get_tile_versions();
  EXPECT_EQ(after.map.map_id, new_id);
  EXPECT_TRUE(after.tiles.empty());
  // Scans count from the start again: an older stamp is no longer out of order.
  drive(publisher_, 0, 4);
  ASSERT_TRUE(wait_for_scans(client_, 12));
  EXPECT_EQ(client_.status().dropped(), 0U);
}

}  // namespace
}  // namespace stillmap::test
