#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <map>
#include <mutex>

#include "core/map/storage/map_file.hpp"
#include "core/simulation/simulation.hpp"
#include "tests/server/server_process.hpp"
#include "tests/slowdown.hpp"

namespace stillmap::test {
namespace {

/// Twice round some blocks by a lidar of 16 rings, whose odometry is 0.3 m off after a round.
simulation::SimulationConfig two_rounds() {
  simulation::SimulationConfig config;
  config.seed = 1;
  config.sensor = vlp_16();
  config.scans = 1250;
  return config;
}

using TruePoses = std::map<std::int64_t, Eigen::Isometry3d>;

/// Of the worst pose, after the best rigid fit.
double error_m(const std::vector<StampedPose>& path, const TruePoses& truth) {
  Eigen::Matrix3Xd estimated(3, path.size());
  Eigen::Matrix3Xd actual(3, path.size());
  for (std::size_t i = 0; i < path.size(); ++i) {
    estimated.col(static_cast<Eigen::Index>(i)) = path[i].T_map_lidar.translation();
    actual.col(static_cast<Eigen::Index>(i)) = truth.at(path[i].stamp_ns).translation();
  }
  const Eigen::Matrix4d fit = Eigen::umeyama(estimated, actual, false);
  return ((fit.topLeftCorner<3, 3>() * estimated).colwise() + fit.topRightCorner<3, 1>() - actual)
      .colwise()
      .norm()
      .maxCoeff();
}

/// Tiles as a client has them that follows the topic.
class Follower {
 public:
  explicit Follower(Client& client)
      : subscription_(
            client.subscribe_tile_index([this](const dds::MapIdentity&, const TileInfo& info) {
              const std::scoped_lock lock(mutex_);
              if (info.voxel_count == 0) {
                hashes_.erase(info.id);
              } else {
                hashes_[info.id] = info.content_hash;
              }
            })) {}
  [[nodiscard]] std::map<TileId, std::uint64_t> hashes() {
    const std::scoped_lock lock(mutex_);
    return hashes_;
  }

 private:
  std::mutex mutex_;
  std::map<TileId, std::uint64_t> hashes_;
  Subscription subscription_;
};

/// Publishes the drive no faster than the search for loops, which leaves scans out else.
TruePoses drive_two_rounds(Client& client, ScanPublisher& publisher) {
  const simulation::Simulation simulation(two_rounds());
  TruePoses truth;
  for (int k = 0; k < two_rounds().scans; ++k) {
    const simulation::SimulatedScan scan = simulation.scan(k);
    truth[scan.scan.stamp_ns] = scan.T_map_lidar;
    EXPECT_TRUE(publisher.publish(scan.scan, {}, patience));
    if (k % 10 == 9) {
      EXPECT_TRUE(wait_for_scans(client, static_cast<std::uint64_t>(k) + 1));
    }
  }
  return truth;
}

std::uint64_t corrections(Client& client) { return client.status().counter("map_corrections"); }

/// The search is up to twenty scans behind, and the map a correction.
void wait_for_the_last_correction(Client& client) {
  EXPECT_TRUE(eventually([&] { return corrections(client) > 0; }));
  for (std::uint64_t known = 0; known != corrections(client);) {
    known = corrections(client);
    std::this_thread::sleep_for(std::chrono::seconds(3));
  }
}

/// Whether each pose is one of the path's.
bool are_on_path(const Trajectory& poses, const std::vector<StampedPose>& path) {
  return std::ranges::all_of(poses, [&](const StampedPose& pose) {
    const auto stored = std::ranges::find(path, pose.stamp_ns, &StampedPose::stamp_ns);
    return stored != path.end() && pose.T_map_lidar.isApprox(stored->T_map_lidar, 1e-9);
  });
}

TEST(LoopService, APlaceSeenAgainCorrectsTheMapThatIsServedAndStored) {
  if (slowdown > 1) GTEST_SKIP() << "1250 scans take an hour under a sanitizer";
  const ServiceSetup setup("every");
  setup.add("labels: {source: none}\noccupancy: {enabled: false}\n");
  ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  Follower follower(client);
  std::mutex mutex;
  std::vector<StampedPose> as_published;
  const Subscription odometry = client.subscribe_odometry([&](const OdometryUpdate& update) {
    const std::scoped_lock lock(mutex);
    as_published.push_back(update.pose);
  });
  ScanPublisher publisher(setup.publisher(true));
  ASSERT_TRUE(publisher.wait_for_subscriber(patience));
  const TruePoses truth = drive_two_rounds(client, publisher);
  wait_for_the_last_correction(client);
  EXPECT_GT(client.status().counter("loops_closed"), 0U);

  // Who joins now is told where the submaps lie, as the map has them.
  SubmapsOfMap submaps;
  const Subscription joining = client.subscribe_submaps([&](const SubmapsOfMap& arrived) {
    const std::scoped_lock lock(mutex);
    submaps = arrived;
  });
  ASSERT_TRUE(eventually([&] {
    const std::scoped_lock lock(mutex);
    return submaps.list.graph_revision > 0 && !submaps.list.loops.empty();
  }));

  // Who followed the map through the correction has what the file has.
  static_cast<void>(client.save_map());
  const SavedMap saved = open_map_file(setup.map_file())->load();
  std::map<TileId, std::uint64_t> stored;
  for (const auto& tile : saved.view.tiles) stored[tile->info.id] = tile->info.content_hash;
  EXPECT_TRUE(eventually([&] { return follower.hashes() == stored; }))
      << follower.hashes().size() << " and " << stored.size() << " tiles";

  const std::vector<StampedPose> path(saved.trajectory.begin(), saved.trajectory.end());
  ASSERT_EQ(path.size(), truth.size());

  // The path that is published is the corrected one, also when no scan comes any more.
  Trajectory published;
  const Subscription paths = client.subscribe_path([&](const Trajectory& arrived) {
    const std::scoped_lock lock(mutex);
    published = arrived;
  });
  EXPECT_TRUE(eventually([&] {
    const std::scoped_lock lock(mutex);
    return !published.empty() && are_on_path(published, path);
  }));
  const std::scoped_lock lock(mutex);
  EXPECT_EQ(submaps.map_id, saved.view.map_id);
  EXPECT_EQ(submaps.list.graph_revision, corrections(client));
  EXPECT_GT(submaps.list.submaps.size(), 4U);
  Trajectory submap_poses;
  for (const SubmapList::Entry& submap : submaps.list.submaps) {
    submap_poses.push_back({submap.stamp_ns, submap.T_map_submap});
  }
  EXPECT_TRUE(are_on_path(submap_poses, path));
  EXPECT_LT(error_m(path, truth), 0.6 * error_m(as_published, truth));
  EXPECT_LT(error_m(path, truth), 0.12);
}

}  // namespace
}  // namespace stillmap::test
