#include <gmock/gmock.h>

#include <atomic>
#include <cstdint>
#include <fstream>

#include "core/map/static_map.hpp"
#include "core/map/storage/map_file.hpp"
#include "tests/server/room_scans.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

class LoadService : public testing::Test {
 protected:
  LoadService() : setup_("every"), server_(setup_.server_arguments()), client_(setup_.client()) {
    client_.wait_for_server(patience);
  }

  void map_scans(int first, int last) {
    drive(publisher_, first, last);
    mapped_ += static_cast<std::uint64_t>(last - first);
    ASSERT_TRUE(wait_for_scans(client_, mapped_));
  }
  [[nodiscard]] fs::path beside(const std::string& name) const {
    return setup_.map_file().parent_path() / name;
  }
  /// Why the server does not load `name`; it must go on as if nothing had been asked.
  std::string refusal(const std::string& name) {
    // A save shows what was mapped until now: then nothing changes by itself.
    client_.save_map("shown.stillmap", true);
    const dds::ServerStatus before = client_.status();
    std::string why;
    try {
      client_.load_map(name);
      ADD_FAILURE() << name << " was loaded";
    } catch (const ServiceError& error) {
      why = error.what();
    }
    const dds::ServerStatus after = client_.status();
    EXPECT_EQ(after.map_id, before.map_id) << name;
    EXPECT_EQ(after.voxel_count, before.voxel_count) << name;
    return why;
  }

  ServiceSetup setup_;
  ServerProcess server_;
  Client client_;
  ScanPublisher publisher_{setup_.publisher(true)};
  std::uint64_t mapped_ = 0;
};

TEST_F(LoadService, GoesOnWhereTheLoadedPathEnded) {
  map_scans(0, 8);
  client_.save_map("hall.stillmap");
  map_scans(8, 16);
  const std::uint64_t old_id = client_.status().map_id;

  const LoadedMap loaded = client_.load_map("hall.stillmap");
  EXPECT_EQ(fs::path(loaded.file).filename(), "hall.stillmap");
  EXPECT_NE(loaded.map_id, old_id);
  EXPECT_EQ(loaded.pose_count, 8U);
  const SavedMap hall = open_map_file(beside("hall.stillmap"))->load();
  EXPECT_EQ(loaded.tile_count, hall.view.tiles.size());
  EXPECT_EQ(client_.status().map_id, loaded.map_id);
  std::atomic<std::size_t> path_poses = 0;
  const Subscription path =
      client_.subscribe_path([&](const Trajectory& now) { path_poses = now.size(); });
  EXPECT_TRUE(eventually([&] { return path_poses == 8U; })) << "the loaded path is shown";
  const TileVersions served = client_.get_tile_versions();
  ASSERT_EQ(served.tiles.size(), hall.view.tiles.size());
  for (std::size_t i = 0; i < served.tiles.size(); ++i) {
    EXPECT_EQ(served.tiles[i].content_hash, hall.view.tiles[i]->info.content_hash);
  }
  // The running map was not lost.
  EXPECT_EQ(open_map_file(setup_.map_file())->load().trajectory.size(), 16U);

  map_scans(8, 14);
  server_.send(SIGTERM);
  ASSERT_EQ(server_.wait_for_exit(patience), 0);
  const SavedMap longer = open_map_file(beside("hall.stillmap"))->load();
  ASSERT_EQ(longer.trajectory.size(), 14U);
  EXPECT_EQ(longer.view.map_id, loaded.map_id);
  const Eigen::Isometry3d T_map_room =
      hall.trajectory.front().T_map_lidar * room_pose(0).T_map_lidar.inverse();
  for (const int i : {7, 8, 13}) {
    const Eigen::Vector3d expected = T_map_room * room_pose(i).T_map_lidar.translation();
    const auto& pose = longer.trajectory[static_cast<std::size_t>(i)].T_map_lidar;
    EXPECT_LT((pose.translation() - expected).norm(), 0.3) << i;
  }
  EXPECT_EQ(open_map_file(setup_.map_file())->load().trajectory.size(), 16U);
}

TEST_F(LoadService, AMapThatAResetKeptCanBeLoadedAgain) {
  map_scans(0, 8);
  const BegunMap begun = client_.reset();
  ASSERT_FALSE(begun.kept_file.empty());
  EXPECT_EQ(client_.status().map_id, begun.map_id);
  EXPECT_EQ(open_map_file(begun.kept_file)->load().trajectory.size(), 8U);
  map_scans(20, 24);
  const LoadedMap loaded = client_.load_map(fs::path(begun.kept_file).filename().string());
  EXPECT_EQ(loaded.pose_count, 8U);
  EXPECT_EQ(open_map_file(setup_.map_file())->load().trajectory.size(), 4U);
  EXPECT_TRUE(client_.reset(true).kept_file.empty());
  EXPECT_TRUE(open_map_file(begun.kept_file)->load().view.tiles.empty()) << "it was running";
}

TEST_F(LoadService, WhoComesAfterAResetIsShownNoPathOfTheMapBefore) {
  map_scans(0, 8);
  server_.send(SIGTERM);
  ASSERT_EQ(server_.wait_for_exit(patience), 0);
  // It has added no pose to the path that it shows.
  const ServerProcess resumed(setup_.server_arguments());
  Client client(setup_.client());
  client.wait_for_server(patience);
  const auto shows_path_of = [&](std::size_t poses) {
    std::atomic<std::size_t> shown = SIZE_MAX;
    const Subscription path =
        client.subscribe_path([&](const Trajectory& now) { shown = now.size(); });
    return eventually([&] { return shown == poses; });
  };
  ASSERT_TRUE(shows_path_of(8));
  static_cast<void>(client.reset());
  EXPECT_TRUE(shows_path_of(0));
}

TEST_F(LoadService, ASecondServerOfTheFileEndsAndNamesTheFirst) {
  testing::internal::CaptureStderr();
  ServerProcess second(setup_.server_arguments());
  EXPECT_EQ(second.wait_for_exit(patience), 1);
  EXPECT_THAT(testing::internal::GetCapturedStderr(), HasSubstr("in use by process"));
  map_scans(0, 4);
  server_.send(SIGKILL);
  ASSERT_EQ(server_.wait_for_exit(patience), -1);
  ServerProcess third(setup_.server_arguments());
  Client client(setup_.client());
  EXPECT_NO_THROW(client.wait_for_server(patience)) << "the dead hold no lock";
}

TEST_F(LoadService, TellsClientsThatAnotherMapBegan) {
  map_scans(0, 8);
  client_.save_map("hall.stillmap");
  MapQuery query;
  query.max_bytes = 2000;
  const MapQueryResult first = client_.get_static_map(query);
  ASSERT_FALSE(first.continuation.empty());
  const LoadedMap loaded = client_.load_map("hall.stillmap");
  MapQuery changes;
  changes.since = {.map_id = first.map_id, .version = first.map_version};
  EXPECT_EQ(client_.get_static_map(changes).status, QueryStatus::changes_unknown);
  const MapQueryResult all = client_.get_whole_static_map({});
  EXPECT_EQ(all.map_id, loaded.map_id);
  EXPECT_GT(all.voxels.size(), 0U);
}

TEST_F(LoadService, RefusesWhatItCannotGoOnWith) {
  map_scans(0, 8);
  client_.save_map("good.stillmap");
  SavedMap other = open_map_file(beside("good.stillmap"))->load();
  other.view.tiles = {};
  open_map_file(beside("no_tiles.stillmap"))->save(other);
  std::string bytes = content_of(beside("good.stillmap"));
  std::ofstream(beside("newer.stillmap"), std::ios::binary)
      << std::string(bytes).replace(60, 4, "\0\0\1\0", 4);
  std::ofstream(beside("cut.stillmap"), std::ios::binary) << bytes.substr(0, bytes.size() / 2);
  std::ofstream(beside("text.stillmap")) << "no database, and to stay as it is";
  std::ofstream(beside("nothing.stillmap"));
  fs::create_directory(beside("folder.stillmap"));
  for (const auto& [name, named] :
       {std::pair("missing.stillmap", "is not there"), std::pair("no_tiles.stillmap", "no map"),
        std::pair("newer.stillmap", "newer"), std::pair("cut.stillmap", "damaged"),
        std::pair("text.stillmap", "not a map file"), std::pair("nothing.stillmap", "no map"),
        std::pair("folder.stillmap", "not a file"), std::pair("../map.stillmap", "plain name"),
        std::pair("/etc/passwd", "plain name"), std::pair("..", "plain name")}) {
    EXPECT_THAT(refusal(name), HasSubstr(named)) << name;
  }
  EXPECT_FALSE(fs::exists(beside("missing.stillmap")));
  EXPECT_EQ(content_of(beside("text.stillmap")), "no database, and to stay as it is");
  EXPECT_EQ(fs::file_size(beside("nothing.stillmap")), 0U);
  map_scans(8, 10);
  EXPECT_EQ(client_.load_map("good.stillmap").pose_count, 8U);
}

TEST_F(LoadService, RefusesAMapOfAnotherVoxelSize) {
  map_scans(0, 8);
  StaticMapConfig coarse;
  coarse.voxel_size_m *= 2.0;
  StaticMap map(coarse);
  LabelledScan scan;
  scan.scan.points_lidar.assign(20, Eigen::Vector3f(1, 1, 1));
  scan.motion.assign(20, Motion::stationary);
  map.insert(scan, Eigen::Isometry3d::Identity());
  ASSERT_FALSE(map.view()->tiles.empty());
  open_map_file(beside("coarse.stillmap"))
      ->save({.view = *map.view(), .tile_evidence = {}, .trajectory = {}, .metadata = {}});
  EXPECT_THAT(refusal("coarse.stillmap"), HasSubstr("voxel_size_m"));
}

}  // namespace
}  // namespace stillmap::test
