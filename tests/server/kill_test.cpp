#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <map>
#include <mutex>
#include <optional>
#include <random>
#include <thread>
#include <utility>

#include "core/map/storage/map_file.hpp"
#include "tests/server/room_scans.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

constexpr double checkpoint_period_s = 0.5;
/// A machine under load takes its time for a checkpoint.
constexpr double slack_s = 4.0 * slowdown;

int wanted_kills() {
  const char* const text = std::getenv("STILLMAP_KILLS");
  return text == nullptr ? 3 : std::atoi(text);
}

/// When a client saw what: poses by stamp, a tile's revisions.
class SeenByClient {
 public:
  void see_pose(std::int64_t stamp_ns) {
    const std::scoped_lock lock(mutex_);
    poses_.emplace(stamp_ns, Clock::now());
  }
  void see_tile(const TileInfo& info) {
    const std::scoped_lock lock(mutex_);
    if (info.voxel_count > 0) tiles_[info.id].emplace(info.revision, Clock::now());
  }
  [[nodiscard]] std::size_t poses() const {
    const std::scoped_lock lock(mutex_);
    return poses_.size();
  }
  /// How long before `end` the first of all this came that is not stored; 0 when all is.
  [[nodiscard]] double lost_s(const SavedMap& stored, Clock::time_point end) const {
    const std::scoped_lock lock(mutex_);
    const std::int64_t last_ns = stored.trajectory.empty() ? 0 : stored.trajectory.back().stamp_ns;
    double lost_s = age_s(poses_.upper_bound(last_ns), poses_.end(), end);
    for (const auto& [id, revisions] : tiles_) {
      const auto tile = stored.view.tiles.find(id);
      const std::uint64_t last = tile == nullptr ? 0 : tile->info.revision;
      lost_s = std::max(lost_s, age_s(revisions.upper_bound(last), revisions.end(), end));
    }
    return lost_s;
  }

 private:
  template <typename Iterator>
  [[nodiscard]] static double age_s(Iterator first_lost, Iterator last, Clock::time_point end) {
    return first_lost == last ? 0.0 : Seconds(end - first_lost->second).count();
  }

  mutable std::mutex mutex_;
  std::map<std::int64_t, Clock::time_point> poses_;
  std::map<TileId, std::map<std::uint64_t, Clock::time_point>> tiles_;
};

struct Loss {
  SavedMap stored;
  double lost_s = 0.0;
};

/// Maps from scan `next` on, which goes on with the drive, until the server is killed; what its
/// file lost.
Loss kill_while_mapping(const ServiceSetup& setup, int& next, double after_s) {
  SeenByClient seen;
  ServerProcess server(setup.server_arguments());
  Clock::time_point killed;
  {
    Client client(setup.client());
    client.wait_for_server(patience);
    const auto poses = client.subscribe_odometry(
        [&](const OdometryUpdate& update) { seen.see_pose(update.pose.stamp_ns); });
    const auto tiles = client.subscribe_tile_index(
        [&](const dds::MapIdentity&, const TileInfo& info) { seen.see_tile(info); });
    ScanPublisher publisher(setup.publisher(true));
    EXPECT_TRUE(publisher.wait_for_subscriber(patience));
    std::jthread driver([&](const std::stop_token& stop) {
      for (; !stop.stop_requested(); ++next) {
        // A full history makes it wait; once the server is dead nothing more can be sent.
        if (!publisher.publish(room_scan(next), {}, std::chrono::milliseconds(200))) continue;
        std::this_thread::sleep_for(std::chrono::milliseconds(30));
      }
    });
    EXPECT_TRUE(eventually([&] { return seen.poses() > 3; }));
    std::this_thread::sleep_for(Seconds(after_s));
    server.send(SIGKILL);
    killed = Clock::now();
    EXPECT_EQ(server.wait_for_exit(patience), -1);
  }
  SavedMap stored = open_map_file(setup.map_file())->load();
  const double lost_s = seen.lost_s(stored, killed);
  return {std::move(stored), lost_s};
}

/// What was stored once stays: the path, every tile's last change.
void expect_goes_on(const SavedMap& before, const SavedMap& after) {
  ASSERT_GE(after.trajectory.size(), before.trajectory.size());
  for (const auto& tile : before.view.tiles) {
    const auto now = after.view.tiles.find(tile->info.id);
    ASSERT_NE(now, nullptr) << "a tile of " << tile->info.voxel_count << " voxels is gone";
    EXPECT_GE(now->info.revision, tile->info.revision);
    if (now->info.revision == tile->info.revision) {
      EXPECT_EQ(now->info.content_hash, tile->info.content_hash);
    }
  }
}

TEST(Kill, AtAnyMomentTheFileOpensAndAtMostACheckpointPeriodIsLost) {
  const ServiceSetup setup("every", "save_period_s: 0.5");
  std::mt19937 random(std::random_device{}());
  std::uniform_real_distribution<double> after_s(0.0, 2.0);
  std::vector<double> losses;
  std::optional<SavedMap> stored;
  int next = 0;
  for (int kill = 0; kill < wanted_kills(); ++kill) {
    Loss loss = kill_while_mapping(setup, next, after_s(random));
    EXPECT_LE(loss.lost_s, checkpoint_period_s + slack_s);
    if (stored) expect_goes_on(*stored, loss.stored);
    stored = std::move(loss.stored);
    losses.push_back(loss.lost_s);
  }
  std::ranges::sort(losses);
  std::cout << losses.size() << " kills, checkpoints every " << checkpoint_period_s
            << " s; lost: median " << losses[losses.size() / 2] << " s, most " << losses.back()
            << " s; the file opened every time; in it " << stored->trajectory.size() << " poses, "
            << stored->view.tiles.size() << " tiles\n";
}

}  // namespace
}  // namespace stillmap::test
