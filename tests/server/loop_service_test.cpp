#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <map>
#include <mutex>
#include <numbers>

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

/// Publishes these scans of the drive no faster than the search for loops, which leaves some out
/// else. Adds the true poses.
void drive_rounds(const simulation::SimulationConfig& config, int from, int to, Client& client,
                  ScanPublisher& publisher, TruePoses& truth) {
  const simulation::Simulation simulation(config);
  for (int k = from; k < to; ++k) {
    const simulation::SimulatedScan scan = simulation.scan(k);
    truth[scan.scan.stamp_ns] = scan.T_map_lidar;
    EXPECT_TRUE(publisher.publish(scan.scan, {}, patience));
    if (k % 10 == 9) {
      EXPECT_TRUE(wait_for_scans(client, static_cast<std::uint64_t>(k - from) + 1));
    }
  }
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

/// What the odometry topic brings, as it was published.
class PublishedOdometry {
 public:
  explicit PublishedOdometry(Client& client)
      : subscription_(client.subscribe_odometry([this](const OdometryUpdate& update) {
          const std::scoped_lock lock(mutex_);
          poses_.push_back(update.pose);
        })) {}
  [[nodiscard]] std::vector<StampedPose> poses() {
    const std::scoped_lock lock(mutex_);
    return poses_;
  }

 private:
  std::mutex mutex_;
  std::vector<StampedPose> poses_;
  Subscription subscription_;
};

/// Who joins now is told where the submaps lie, as the map has them.
SubmapsOfMap submaps_of_a_new_subscriber(Client& client) {
  std::mutex mutex;
  SubmapsOfMap submaps;
  const Subscription joining = client.subscribe_submaps([&](const SubmapsOfMap& arrived) {
    const std::scoped_lock lock(mutex);
    submaps = arrived;
  });
  EXPECT_TRUE(eventually([&] {
    const std::scoped_lock lock(mutex);
    return submaps.list.graph_revision > 0 && !submaps.list.loops.empty();
  }));
  const std::scoped_lock lock(mutex);
  return submaps;
}

/// What is saved, once who followed the map through the corrections has the same: on a busy machine
/// one may be in work for longer than was waited for the last.
SavedMap save_as_followed(Client& client, Follower& follower, const std::string& file) {
  SavedMap saved;
  std::map<TileId, std::uint64_t> stored;
  const bool are_same = eventually(
      [&] {
        static_cast<void>(client.save_map());
        saved = open_map_file(file)->load();
        stored.clear();
        for (const auto& tile : saved.view.tiles) stored[tile->info.id] = tile->info.content_hash;
        return follower.hashes() == stored;
      },
      patience, std::chrono::milliseconds(500));
  EXPECT_TRUE(are_same) << follower.hashes().size() << " and " << stored.size() << " tiles";
  return saved;
}

/// The path that is published is the corrected one, also when no scan comes any more.
void expect_published_path_on(Client& client, const std::vector<StampedPose>& path) {
  std::mutex mutex;
  Trajectory published;
  const Subscription paths = client.subscribe_path([&](const Trajectory& arrived) {
    const std::scoped_lock lock(mutex);
    published = arrived;
  });
  EXPECT_TRUE(eventually([&] {
    const std::scoped_lock lock(mutex);
    return !published.empty() && are_on_path(published, path);
  }));
}

Trajectory poses_of(const SubmapsOfMap& submaps) {
  Trajectory poses;
  for (const SubmapList::Entry& submap : submaps.list.submaps) {
    poses.push_back({submap.stamp_ns, submap.T_map_submap});
  }
  return poses;
}

TEST(LoopService, APlaceSeenAgainCorrectsTheMapThatIsServedAndStored) {
  if (slowdown > 1) GTEST_SKIP() << "1250 scans take an hour under a sanitizer";
  const ServiceSetup setup("every");
  setup.add("labels: {source: none}\noccupancy: {enabled: false}\n");
  ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  Follower follower(client);
  PublishedOdometry as_published(client);
  ScanPublisher publisher(setup.publisher(true));
  ASSERT_TRUE(publisher.wait_for_subscriber(patience));
  TruePoses truth;
  drive_rounds(two_rounds(), 0, two_rounds().scans, client, publisher, truth);
  wait_for_the_last_correction(client);
  EXPECT_GT(client.status().counter("loops_closed"), 0U);

  const SavedMap saved = save_as_followed(client, follower, setup.map_file());
  const SubmapsOfMap submaps = submaps_of_a_new_subscriber(client);
  const std::vector<StampedPose> path(saved.trajectory.begin(), saved.trajectory.end());
  ASSERT_EQ(path.size(), truth.size());
  expect_published_path_on(client, path);
  EXPECT_EQ(submaps.map_id, saved.view.map_id);
  EXPECT_EQ(submaps.list.graph_revision, corrections(client));
  EXPECT_GT(submaps.list.submaps.size(), 4U);
  EXPECT_TRUE(are_on_path(poses_of(submaps), path));
  // Odometry alone drifts little here: by less than 0.1 m.
  EXPECT_LT(error_m(path, truth), error_m(as_published.poses(), truth));
  EXPECT_LT(error_m(path, truth), 0.12);
}

/// How far the last poses are from where those taken nearest to them in the first run have them.
double worst_revisit_m(const std::vector<StampedPose>& path, std::size_t first_run,
                       std::size_t last_poses, const TruePoses& truth) {
  double worst = 0.0;
  for (std::size_t i = path.size() - last_poses; i < path.size(); ++i) {
    const Eigen::Isometry3d& T_true = truth.at(path[i].stamp_ns);
    const auto nearest = std::ranges::min_element(
        path.begin(), path.begin() + static_cast<std::ptrdiff_t>(first_run), {},
        [&](const StampedPose& pose) {
          return (truth.at(pose.stamp_ns).translation() - T_true.translation()).norm();
        });
    const Eigen::Isometry3d T_true_first_last = truth.at(nearest->stamp_ns).inverse() * T_true;
    const Eigen::Isometry3d T_first_last = nearest->T_map_lidar.inverse() * path[i].T_map_lidar;
    worst = std::max(worst, (T_true_first_last.translation() - T_first_last.translation()).norm());
  }
  return worst;
}

// By a lidar whose beams all lie half a degree off, so that its odometry is a metre off after the
// round that leads back to the map that was loaded.
TEST(LoopService, AMapThatWasLoadedStaysAndWhatIsSeenSinceIsMovedToFitIt) {
  if (slowdown > 1) GTEST_SKIP() << "1180 scans take an hour under a sanitizer";
  constexpr int first_scans = 200;
  constexpr int scans = 1180;
  simulation::SimulationConfig config = two_rounds();
  config.sensor.elevation_offset = 0.5 * std::numbers::pi / 180.0;
  const ServiceSetup setup("every");
  setup.add("labels: {source: none}\noccupancy: {enabled: false}\n");
  TruePoses truth;
  const auto run = [&](int from, int to) {
    ServerProcess server(setup.server_arguments());
    Client client(setup.client());
    client.wait_for_server(patience);
    ScanPublisher publisher(setup.publisher(true));
    ASSERT_TRUE(publisher.wait_for_subscriber(patience));
    drive_rounds(config, from, to, client, publisher, truth);
    if (from > 0) {
      wait_for_the_last_correction(client);
      EXPECT_GE(client.status().counter("submaps_in_earlier_map"), 2U);
    }
    server.send(SIGTERM);
    ASSERT_EQ(server.wait_for_exit(patience), 0);
  };
  const auto stored = [&] { return open_map_file(setup.map_file())->load(); };
  run(0, first_scans);
  const SavedMap first = stored();
  ASSERT_EQ(first.trajectory.size(), static_cast<std::size_t>(first_scans));
  run(first_scans, scans);

  const SavedMap both = stored();
  ASSERT_EQ(both.trajectory.size(), static_cast<std::size_t>(scans));
  EXPECT_EQ(SharedTrajectory::common_poses(first.trajectory, both.trajectory),
            first.trajectory.size())
      << "what was there moved";
  const std::vector<StampedPose> path(both.trajectory.begin(), both.trajectory.end());
  // 1.2 m where loops stay open; corrections come at other scans each time.
  EXPECT_LT(worst_revisit_m(path, first_scans, 20, truth), 0.4);
}

}  // namespace
}  // namespace stillmap::test
