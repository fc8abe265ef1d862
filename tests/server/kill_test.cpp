#include <gtest/gtest.h>
#include <signal.h>

#include <algorithm>
#include <cstdlib>
#include <iostream>
#include <map>
#include <mutex>
#include <random>
#include <thread>

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

/// When clients saw the pose of which scan.
class SeenPoses {
 public:
  void see(std::int64_t stamp_ns) {
    const std::scoped_lock lock(mutex_);
    seen_.emplace(stamp_ns, Clock::now());
  }
  [[nodiscard]] std::size_t count() const {
    const std::scoped_lock lock(mutex_);
    return seen_.size();
  }
  /// How long before `end` the first pose came that is not stored; 0 when all are.
  [[nodiscard]] double lost_s(std::int64_t last_stored_ns, Clock::time_point end) const {
    const std::scoped_lock lock(mutex_);
    const auto first_lost = seen_.upper_bound(last_stored_ns);
    return first_lost == seen_.end() ? 0.0 : Seconds(end - first_lost->second).count();
  }

 private:
  mutable std::mutex mutex_;
  std::map<std::int64_t, Clock::time_point> seen_;
};

struct Loss {
  std::size_t seen = 0;
  std::size_t stored = 0;
  double lost_s = 0.0;
};

/// Maps from scan `first` on until the server is killed; what its file lost.
Loss kill_while_mapping(const ServiceSetup& setup, int first, double after_s) {
  SeenPoses poses;
  ServerProcess server(setup.server_arguments());
  Clock::time_point killed;
  {
    Client client(setup.client());
    client.wait_for_server(patience);
    const auto subscription = client.subscribe_odometry(
        [&](const OdometryUpdate& update) { poses.see(update.pose.stamp_ns); });
    ScanPublisher publisher(setup.publisher(true));
    EXPECT_TRUE(publisher.wait_for_subscriber(patience));
    std::jthread driver([&](const std::stop_token& stop) {
      for (int i = first; !stop.stop_requested(); ++i) {
        // A full history makes it wait; once the server is dead nothing more can be sent.
        if (!publisher.publish(room_scan(i), {}, std::chrono::milliseconds(200))) continue;
        std::this_thread::sleep_for(std::chrono::milliseconds(30));
      }
    });
    EXPECT_TRUE(eventually([&] { return poses.count() > 3; }));
    std::this_thread::sleep_for(Seconds(after_s));
    server.send(SIGKILL);
    killed = Clock::now();
    EXPECT_EQ(server.wait_for_exit(patience), -1);
  }
  const SavedMap stored = open_map_file(setup.map_file())->load();
  const std::int64_t last_ns = stored.trajectory.empty() ? 0 : stored.trajectory.back().stamp_ns;
  return {poses.count(), stored.trajectory.size(), poses.lost_s(last_ns, killed)};
}

TEST(Kill, AtAnyMomentTheFileOpensAndAtMostACheckpointPeriodIsLost) {
  const ServiceSetup setup("every", "save_period_s: 0.5");
  std::mt19937 random(std::random_device{}());
  std::uniform_real_distribution<double> after_s(0.0, 2.0);
  std::vector<double> losses;
  std::size_t stored = 0;
  for (int kill = 0; kill < wanted_kills(); ++kill) {
    const Loss loss = kill_while_mapping(setup, kill * 1000, after_s(random));
    EXPECT_LE(loss.lost_s, checkpoint_period_s + slack_s);
    EXPECT_GE(loss.stored, stored) << "a path that was stored once got shorter";
    stored = loss.stored;
    losses.push_back(loss.lost_s);
  }
  std::ranges::sort(losses);
  std::cout << losses.size() << " kills, checkpoints every " << checkpoint_period_s
            << " s; lost: median " << losses[losses.size() / 2] << " s, most " << losses.back()
            << " s; the file opened every time, " << stored << " poses in it\n";
}

}  // namespace
}  // namespace stillmap::test
