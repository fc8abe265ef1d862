#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <atomic>
#include <fstream>
#include <set>

#include "core/map/storage/map_file.hpp"
#include "core/map/storage/map_sessions.hpp"
#include "core/simulation/simulation.hpp"
#include "idl/dds/reader.hpp"
#include "idl/interface/topics.hpp"
#include "sensor_msgs.h"
#include "tests/idl/vendor_participant.hpp"
#include "tests/server/room_scans.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

/// Maps scans `first` .. `last` - 1 with a fresh server process; `end` finishes it.
template <typename End>
void run_server(const ServiceSetup& setup, int first, int last, End end) {
  ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  ScanPublisher publisher(setup.publisher(true));
  drive(publisher, first, last);
  ASSERT_TRUE(wait_for_scans(client, static_cast<std::uint64_t>(last - first)));
  end(server, client);
}

void terminate(ServerProcess& server, Client&) {
  server.send(SIGTERM);
  EXPECT_EQ(server.wait_for_exit(patience), 0);
}

TEST(Restart, SigtermSavesTheMapAndTheNextServerServesIt) {
  const ServiceSetup setup("every");
  run_server(setup, 0, 8, terminate);
  const SavedMap stored = open_map_file(setup.map_file())->load();
  EXPECT_EQ(stored.trajectory.size(), 8U);
  ASSERT_FALSE(stored.view.tiles.empty());

  const ServerProcess next(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  const TileVersions served = client.get_tile_versions();
  EXPECT_EQ(served.map.version, stored.view.version);
  ASSERT_EQ(served.tiles.size(), stored.view.tiles.size());
  for (std::size_t i = 0; i < served.tiles.size(); ++i) {
    EXPECT_EQ(served.tiles[i].content_hash, stored.view.tiles[i]->info.content_hash);
  }
}

TEST(Restart, GoesOnWithMapAndPath) {
  const ServiceSetup setup("every");
  run_server(setup, 0, 8, terminate);
  run_server(setup, 8, 14, terminate);
  const SavedMap stored = open_map_file(setup.map_file())->load();
  ASSERT_EQ(stored.trajectory.size(), 14U);
  const Eigen::Vector3d step = stored.trajectory[8].T_map_lidar.translation() -
                               stored.trajectory[7].T_map_lidar.translation();
  EXPECT_LT(step.norm(), 0.5);
}

// 12 m/s and a lidar that turns: one that is taken to have stood is found elsewhere or nowhere.
TEST(Restart, GoesOnAsFastAsTheRobotDid) {
  const ServiceSetup setup("every");
  simulation::SimulationConfig config;
  config.sensor = vlp_16();
  config.scans = 36;
  config.rolling = true;
  config.motion = simulation::LidarMotion::hard_turns;
  const simulation::Simulation drive(config);
  constexpr int stopped_at = 30;
  for (const auto& [first, last] : {std::pair(0, stopped_at), {stopped_at, config.scans}}) {
    ServerProcess server(setup.server_arguments());
    Client client(setup.client());
    client.wait_for_server(patience);
    ScanPublisher publisher(setup.publisher(true));
    ASSERT_TRUE(publisher.wait_for_subscriber(patience));
    for (int k = first; k < last; ++k) {
      const simulation::SimulatedScan seen = drive.scan(k);
      ASSERT_TRUE(publisher.publish(seen.scan, seen.raw_labels, patience)) << k;
    }
    ASSERT_TRUE(wait_for_scans(client, static_cast<std::uint64_t>(last - first)));
    terminate(server, client);
  }
  const SharedTrajectory path = open_map_file(setup.map_file())->load().trajectory;
  ASSERT_EQ(path.size(), static_cast<std::size_t>(config.scans));
  const Eigen::Isometry3d moved =
      path[stopped_at - 1].T_map_lidar.inverse() * path[stopped_at].T_map_lidar;
  const double period_s = config.sensor.period_s;
  const Eigen::Isometry3d truth = drive.T_map_lidar_at((stopped_at - 1) * period_s).inverse() *
                                  drive.T_map_lidar_at(stopped_at * period_s);
  EXPECT_LT((moved.translation() - truth.translation()).norm(), 0.1);
}

TEST(Restart, EachRunIsASessionThatCanBeWithdrawn) {
  const ServiceSetup setup("every");
  run_server(setup, 0, 8, terminate);
  const SavedMap first = open_map_file(setup.map_file())->load();
  run_server(setup, 8, 14, [](ServerProcess& server, Client& client) {
    client.save_map();
    terminate(server, client);
  });
  const std::vector<MapSession> sessions = read_map_sessions(setup.map_file());
  ASSERT_EQ(sessions.size(), 2U);
  EXPECT_EQ(sessions[0].poses, 8U);
  EXPECT_EQ(sessions[1].poses, 6U);
  EXPECT_THAT(sessions[1].source, testing::StartsWith("server "));

  const ScratchFolder folder;
  withdraw_newest_session(setup.map_file(), folder / "first.stillmap");
  const SavedMap again = open_map_file(folder / "first.stillmap")->load();
  EXPECT_EQ(again.view.version, first.view.version);
  EXPECT_TRUE(first.metadata.contains(map_ended_key));
  EXPECT_FALSE(again.metadata.contains(map_ended_key)) << "that run went on";
  EXPECT_EQ(again.trajectory.size(), 8U);
  ASSERT_EQ(again.view.tiles.size(), first.view.tiles.size());
  for (std::size_t i = 0; i < first.view.tiles.size(); ++i) {
    EXPECT_EQ(again.view.tiles[i]->info.content_hash, first.view.tiles[i]->info.content_hash);
  }
}

/// Scans of the room with another clock.
void drive_at(ScanPublisher& publisher, int first, int last, std::int64_t offset_ns) {
  ASSERT_TRUE(publisher.wait_for_subscriber(patience));
  for (int i = first; i < last; ++i) {
    Scan scan = room_scan(i);
    scan.stamp_ns += offset_ns;
    ASSERT_TRUE(publisher.publish(scan, {}, patience)) << "scan " << i;
  }
}

// Time since boot, or a clock that is not set yet: stamps before the stored path's, or among them.
TEST(Restart, AnEarlierClockNeitherDeletesThePathNorMisplacesTheMap) {
  const ServiceSetup setup("every");
  run_server(setup, 0, 10, terminate);
  const SavedMap before = open_map_file(setup.map_file())->load();
  ASSERT_EQ(before.trajectory.size(), 10U);
  const std::int64_t day_ns = 86'400'000'000'000;
  const std::int64_t amid_ns = -room_scan(10).stamp_ns + room_scan(3).stamp_ns + 12'345'678;
  for (const std::int64_t offset_ns : {-day_ns, amid_ns}) {
    const SavedMap earlier = open_map_file(setup.map_file())->load();
    ServerProcess server(setup.server_arguments());
    Client client(setup.client());
    client.wait_for_server(patience);
    ScanPublisher publisher(setup.publisher(true));
    drive_at(publisher, 10, 13, offset_ns);
    ASSERT_TRUE(wait_for_scans(client, 3));
    terminate(server, client);
    const SavedMap stored = open_map_file(setup.map_file())->load();
    ASSERT_EQ(stored.trajectory.size(), earlier.trajectory.size() + 3);
    for (std::size_t i = 0; i < earlier.trajectory.size(); ++i) {
      EXPECT_EQ(stored.trajectory[i].stamp_ns, earlier.trajectory[i].stamp_ns);
    }
    const Eigen::Isometry3d T_map_room =
        before.trajectory.front().T_map_lidar * room_pose(0).T_map_lidar.inverse();
    const Eigen::Vector3d expected = T_map_room * room_pose(12).T_map_lidar.translation();
    EXPECT_LT((stored.trajectory.back().T_map_lidar.translation() - expected).norm(), 0.3);
  }
}

// As when NTP sets a clock that ran ahead: voxels stay, and so does the path that led to them.
TEST(Restart, AClockThatIsSetBackInARunDeletesNothing) {
  const ServiceSetup setup("every");
  const std::int64_t day_ns = 86'400'000'000'000;
  {
    ServerProcess server(setup.server_arguments());
    Client client(setup.client());
    client.wait_for_server(patience);
    ScanPublisher publisher(setup.publisher(true));
    drive(publisher, 0, 10);
    drive_at(publisher, 10, 40, -day_ns);
    ASSERT_TRUE(wait_for_scans(client, 40));
    const dds::ServerStatus status = client.status();
    EXPECT_EQ(status.counter("clock_set_back"), 1U);
    EXPECT_EQ(status.counter("scans_mapped") + status.dropped(), 40U);
    terminate(server, client);
  }
  const SavedMap stored = open_map_file(setup.map_file())->load();
  ASSERT_GT(stored.trajectory.size(), 20U) << "some scans make the mapper believe the clock";
  for (int i = 0; i < 10; ++i) {
    EXPECT_EQ(stored.trajectory[static_cast<std::size_t>(i)].stamp_ns, room_scan(i).stamp_ns);
  }
  EXPECT_EQ(stored.trajectory.back().stamp_ns, room_scan(39).stamp_ns - day_ns);
  // And the next run goes on where this one ended.
  {
    ServerProcess server(setup.server_arguments());
    Client client(setup.client());
    client.wait_for_server(patience);
    ScanPublisher publisher(setup.publisher(true));
    drive_at(publisher, 40, 43, -day_ns);
    ASSERT_TRUE(wait_for_scans(client, 3));
    terminate(server, client);
  }
  const SavedMap longer = open_map_file(setup.map_file())->load();
  ASSERT_EQ(longer.trajectory.size(), stored.trajectory.size() + 3);
  const Eigen::Isometry3d T_map_room =
      longer.trajectory.front().T_map_lidar * room_pose(0).T_map_lidar.inverse();
  const Eigen::Vector3d expected = T_map_room * room_pose(42).T_map_lidar.translation();
  EXPECT_LT((longer.trajectory.back().T_map_lidar.translation() - expected).norm(), 0.3);
}

TEST(Restart, SighupSavesTheMapAsSigtermDoes) {
  const ServiceSetup setup("every");
  run_server(setup, 0, 8, [](ServerProcess& server, Client&) {
    server.send(SIGHUP);
    EXPECT_EQ(server.wait_for_exit(patience), 0);
  });
  EXPECT_EQ(open_map_file(setup.map_file())->load().trajectory.size(), 8U);
}

TEST(Restart, SigintEndsAServerWithoutScans) {
  const ServiceSetup setup("latest");
  ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  server.send(SIGINT);
  EXPECT_EQ(server.wait_for_exit(patience), 0);
}

TEST(Restart, KillBetweenTwoSavesLosesNothingSaved) {
  const ServiceSetup setup("every");
  run_server(setup, 0, 10, [&](ServerProcess& server, Client& client) {
    client.save_map();
    ScanPublisher more(setup.publisher(true));
    drive(more, 10, 14);
    EXPECT_TRUE(wait_for_scans(client, 14));
    server.send(SIGKILL);
    EXPECT_EQ(server.wait_for_exit(patience), -1);
  });
  const SavedMap stored = open_map_file(setup.map_file())->load();
  EXPECT_EQ(stored.trajectory.size(), 10U);
  EXPECT_FALSE(stored.view.tiles.empty());

  const ServerProcess next(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  EXPECT_EQ(client.get_tile_versions().tiles.size(), stored.view.tiles.size());
}

TEST(Restart, WhatDoesNotFitIntoMemoryIsServedFromTheFile) {
  const ServiceSetup setup("every", "save_period_s: 0.2, memory_limit_mib: 1");
  run_server(setup, 0, 30, terminate);
  const SavedMap stored = open_map_file(setup.map_file())->load();

  const ServerProcess next(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  const MapQueryResult all = client.get_whole_static_map(MapQuery{});
  std::size_t voxels = 0;
  std::vector<TileId> ids;
  for (const auto& tile : stored.view.tiles) {
    voxels += tile->voxels.size();
    ids.push_back(tile->info.id);
  }
  EXPECT_EQ(all.voxels.size(), voxels);
  const TileSet tiles = client.get_tiles(ids);
  ASSERT_EQ(tiles.tiles.size(), ids.size());
  std::size_t in_tiles = 0;
  for (const Tile& tile : tiles.tiles) in_tiles += tile.voxels.size();
  EXPECT_EQ(in_tiles, voxels);

  // So is the cloud round the robot.
  dds::Participant participant(setup.dds());
  const auto topic = dds::Topics::in("stillmap").static_cloud;
  dds::Reader<sensor_msgs::msg::PointCloud2> clouds(participant, topic.dds_name, topic.reader);
  EXPECT_TRUE(eventually([&] {
    sensor_msgs::msg::PointCloud2 cloud;
    return clouds.take(cloud, {}, patience) && cloud.width() == voxels;
  }));

  // And mapping goes on in it.
  ScanPublisher publisher(setup.publisher(true));
  drive(publisher, 30, 34);
  EXPECT_TRUE(wait_for_scans(client, 4));
  EXPECT_EQ(client.status().counter("map_tiles_unreadable"), 0U);
}

TEST(Restart, AMapHasANewIdInEveryRun) {
  const ServiceSetup setup("every");
  std::set<std::uint64_t> ids;
  const auto note_id = [&] {
    ids.insert(open_map_file(setup.map_file())->load().view.map_id);
    return ids.size();
  };
  run_server(setup, 0, 6, terminate);
  EXPECT_EQ(note_id(), 1U);
  // What clients saw of the map after the save is not in the file: versions would be given twice.
  run_server(setup, 6, 8, [](ServerProcess& server, Client& client) {
    client.save_map();
    server.send(SIGKILL);
    EXPECT_EQ(server.wait_for_exit(patience), -1);
  });
  EXPECT_EQ(note_id(), 2U);
  run_server(setup, 8, 9, terminate);
  EXPECT_EQ(note_id(), 3U);
}

/// A model folder whose description is sound, and whose network is none.
std::filesystem::path model_without_network(const ScratchFolder& folder) {
  const std::filesystem::path model = folder / "model";
  std::filesystem::create_directory(model);
  std::ofstream(model / "model.yaml")
      << "{name: damaged, licence: MIT, sensor: any, training: none, accuracy: unknown,\n"
      << "image: {rows: 64, columns: 512, fov_up_deg: 3, fov_down_deg: -25},\n"
      << "statistics: {range: {mean: 12, deviation: 12}, x: {mean: 11, deviation: 11},\n"
      << "  y: {mean: 0, deviation: 7}, z: {mean: -1, deviation: 1},\n"
      << "  remission: {mean: 0.2, deviation: 0.2}},\n"
      << "classes: {0: unlabeled, 1: car}}\n";
  std::ofstream(model / "model.onnx") << "half a download";
  return model;
}

TEST(Startup, RefusesAModelThatCannotBeUsedAsItDoesAConfiguration) {
  const ScratchFolder folder;
  const std::filesystem::path file = folder / "server.yaml";
  std::ofstream(file) << "labels: {source: model, model: " << model_without_network(folder).string()
                      << "}\n";
  for (const char* const option : {"--config", "--check-config"}) {
    testing::internal::CaptureStderr();
    ServerProcess server({option, file.string(), "--domain", "231"});
    EXPECT_EQ(server.wait_for_exit(patience), 2) << option;
    EXPECT_THAT(testing::internal::GetCapturedStderr(), testing::HasSubstr("model.onnx"));
  }
}

TEST(Startup, RefusesWhatCannotWorkWithAnExitCode) {
  const ScratchFolder folder;
  std::ofstream(folder / "wrong.yaml") << "no_such_field: 1\n";
  ServerProcess wrong_config({"--config", (folder / "wrong.yaml").string()});
  EXPECT_EQ(wrong_config.wait_for_exit(patience), 2);

  ServerProcess wrong_option({"--no-such-option"});
  EXPECT_EQ(wrong_option.wait_for_exit(patience), 2);

  // As of a variable that is not set.
  ServerProcess no_name({"--map-file", "", "--domain", "231"});
  EXPECT_EQ(no_name.wait_for_exit(patience), 2);
  ServerProcess no_name_either({"--map-file=", "--domain", "231"});
  EXPECT_EQ(no_name_either.wait_for_exit(patience), 2);

  std::ofstream(folder / "text.stillmap") << "this is no database, and must stay as it is";
  ServerProcess wrong_file({"--map-file", (folder / "text.stillmap").string(), "--domain", "231"});
  EXPECT_EQ(wrong_file.wait_for_exit(patience), 2);

  std::filesystem::create_directory(folder / "folder.stillmap");
  ServerProcess a_folder({"--map-file", (folder / "folder.stillmap").string(), "--domain", "231"});
  EXPECT_EQ(a_folder.wait_for_exit(patience), 2);

  // It may be mounted later.
  ServerProcess no_folder(
      {"--map-file", (folder / "no/city.stillmap").string(), "--domain", "231"});
  EXPECT_EQ(no_folder.wait_for_exit(patience), 1);

  std::filesystem::create_symlink(folder / "disk/city.stillmap", folder / "link.stillmap");
  std::filesystem::create_symlink("round.stillmap", folder / "round.stillmap");
  for (const auto& [name, code, why] : {std::tuple("link.stillmap", 1, "is the disk mounted"),
                                        std::tuple("round.stillmap", 2, "leads to no file")}) {
    testing::internal::CaptureStderr();
    ServerProcess linked({"--map-file", (folder / name).string(), "--domain", "231"});
    EXPECT_EQ(linked.wait_for_exit(patience), code) << name;
    EXPECT_THAT(testing::internal::GetCapturedStderr(), testing::HasSubstr(why));
    EXPECT_TRUE(std::filesystem::is_symlink(folder / name)) << name;
  }

  ServerProcess help({"--help"});
  EXPECT_EQ(help.wait_for_exit(patience), 0);
}

/// Counts who joins the test's domain, however short.
class Onlooker : public dds::VendorParticipant::Listener {
 public:
  [[nodiscard]] int joined() const { return joined_; }

 private:
  using Info = eprosima::fastrtps::rtps::ParticipantDiscoveryInfo;
  void on_participant_discovery(eprosima::fastdds::dds::DomainParticipant*, Info&& info) override {
    if (info.status == Info::DISCOVERED_PARTICIPANT) ++joined_;
  }

  std::atomic<int> joined_ = 0;
  const dds::VendorParticipant participant_{dds::eclipse_cyclone, this};
};

/// What a server says that ends by itself, with the exit code after which systemd does not start it
/// again.
std::string last_words(const ServiceSetup& setup) {
  testing::internal::CaptureStderr();
  ServerProcess server(setup.server_arguments());
  EXPECT_EQ(server.wait_for_exit(patience), 2);
  return testing::internal::GetCapturedStderr();
}

TEST(Startup, NobodySeesAServerWhoseMapFileIsUnusable) {
  const Onlooker onlooker;
  const ServiceSetup text("latest");
  std::ofstream(text.map_file()) << "this is no database, and must stay as it is";
  EXPECT_THAT(last_words(text), testing::HasSubstr(text.map_file().string()));

  const ServiceSetup coarse("latest");
  StaticMap map(StaticMapConfig{.voxel_size_m = 0.4});
  LabelledScan scan;
  scan.scan.points_lidar.assign(20, Eigen::Vector3f(1, 1, 1));
  scan.motion.assign(20, Motion::stationary);
  map.insert(scan, Eigen::Isometry3d::Identity());
  open_map_file(coarse.map_file())
      ->save({.view = *map.view(), .tile_evidence = {}, .trajectory = {}, .metadata = {}});
  EXPECT_THAT(last_words(coarse), testing::HasSubstr("voxel_size_m 0.4"));
  EXPECT_EQ(onlooker.joined(), 0);

  const ServiceSetup usable("latest");
  const ServerProcess server(usable.server_arguments());
  EXPECT_TRUE(eventually([&] { return onlooker.joined() > 0; }));
}

}  // namespace
}  // namespace stillmap::test
