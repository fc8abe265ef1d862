#include <gmock/gmock.h>
#include <signal.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <limits>
#include <map>
#include <mutex>
#include <numbers>
#include <optional>

#include "core/map/storage/map_file.hpp"
#include "idl/conversions/localization.hpp"
#include "idl/conversions/pose.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "initial_pose.h"
#include "tests/localization/yard_map.hpp"
#include "tests/server/server_process.hpp"
#include "tests/slowdown.hpp"

namespace stillmap::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
namespace fs = std::filesystem;
using geometry_msgs::msg::PoseWithCovarianceStamped;

/// Scans of the first day that are mapped; the robot stops where the last one was taken.
constexpr int mapped_scans = 180;
/// More than 60 m from there.
constexpr int elsewhere = 60;
/// For one look at the whole map. Under a sanitizer that takes a minute.
constexpr std::chrono::seconds search_patience(slowdown == 1 ? 2 : 20);

/// A scan of the next day by its stamp, too: the server knows a recording that is played again.
simulation::SimulatedScan tomorrow(const simulation::Simulation& simulation, int k) {
  simulation::SimulatedScan scan = simulation.scan(k);
  scan.stamp_ns += 86'400'000'000'000;
  scan.scan.stamp_ns = scan.stamp_ns;
  return scan;
}

/// Publishes scans at the lidar's pace, and keeps what the server says of them.
class Relocation : public testing::Test {
 protected:
  /// The yard, mapped by a server that was stopped then. STILLMAP_YARD names the file that the
  /// tests of one run share.
  static void SetUpTestSuite() {
    folder_ = std::make_unique<ScratchFolder>();
    const fs::path map = *folder_ / "yard.stillmap";
    const char* shared = std::getenv("STILLMAP_YARD");
    if (shared != nullptr && fs::exists(shared)) {
      fs::copy_file(shared, map);
      return;
    }
    map_the_yard(map);
    if (shared == nullptr || HasFatalFailure()) return;
    const std::string complete = shared + ("." + std::to_string(getpid()));
    fs::copy_file(map, complete);
    fs::rename(complete, shared);
  }
  static void map_the_yard(const fs::path& map) {
    const ServiceSetup setup("every");
    ServerProcess server(setup.server_arguments());
    Client client(setup.client());
    client.wait_for_server(patience);
    ScanPublisher publisher(setup.publisher(true));
    ASSERT_TRUE(publisher.wait_for_subscriber(patience));
    const simulation::Simulation simulation(yard(1, 0));
    for (int k = 0; k < mapped_scans; ++k)
      ASSERT_TRUE(publisher.publish(simulation.scan(k).scan, {}, patience));
    ASSERT_TRUE(wait_for_scans(client, mapped_scans));
    server.send(SIGTERM);
    ASSERT_EQ(server.wait_for_exit(patience), 0);
    fs::copy_file(setup.map_file(), map);
  }
  static void TearDownTestSuite() { folder_.reset(); }

  Relocation() : setup_("latest") {}

  void start() {
    fs::copy_file(*folder_ / "yard.stillmap", setup_.map_file());
    before_ = open_map_file(setup_.map_file())->load();
    start_server();
  }
  /// With a map that has every place twice.
  void start_in_yard_twice() {
    const MappedYard twice = yard_twice();
    open_map_file(setup_.map_file())
        ->save({.view = *twice.view,
                .tile_evidence = {},
                .trajectory = twice.trajectory,
                .metadata = {}});
    start_server();
  }
  void start_server() {
    server_.emplace(setup_.server_arguments());
    client_.emplace(setup_.client());
    client_->wait_for_server(patience);
    odometry_ = client_->subscribe_odometry([this](const OdometryUpdate& update) {
      const std::scoped_lock lock(mutex_);
      poses_[update.pose.stamp_ns] = update.pose.T_map_lidar;
    });
    publisher_.emplace(setup_.publisher(false));
    ASSERT_TRUE(publisher_->wait_for_subscriber(patience));
    participant_.emplace(setup_.dds());
    const auto topic = dds::initial_pose_topic("initialpose");
    operator_.emplace(*participant_, topic.dds_name, topic.writer);
    ASSERT_TRUE(eventually([&] { return operator_->readers().count() > 0; }));
  }

  void say_pose(const PoseWithCovarianceStamped& message) {
    ASSERT_TRUE(operator_->write(message));
    is_guessed_ = true;
  }
  [[nodiscard]] std::uint64_t counter(const char* name) { return client_->status().counter(name); }

  /// Publishes scans from `first` on until `is_done`, at most `count`, each when the one before was
  /// mapped and, where something is looked for, the search has taken its turn: on a machine that is
  /// busy, too. The number after the last one.
  template <typename IsDone>
  int drive_until(const simulation::Simulation& simulation, int first, int count, IsDone is_done,
                  int scans_until_search = 1) {
    const auto handled = [](const dds::ServerStatus& status) {
      return status.counter("scans_mapped") + status.dropped();
    };
    int k = first;
    for (; k < first + count && !is_done(); ++k) {
      const dds::ServerStatus before = client_->status();
      EXPECT_TRUE(publisher_->publish(tomorrow(simulation, k).scan, {}, patience));
      EXPECT_TRUE(eventually([&] { return handled(client_->status()) > handled(before); })) << k;
      const bool is_searching =
          k >= first + scans_until_search &&
          (before.health == OdometryHealth::lost || is_guessed_ || scans_until_search > 1);
      if (!is_searching) continue;
      static_cast<void>(eventually(
          [&] { return is_done() || counter("places_tried") > before.counter("places_tried"); },
          search_patience));
    }
    return k;
  }

  [[nodiscard]] std::optional<Eigen::Isometry3d> pose_of(const simulation::SimulatedScan& scan) {
    const std::scoped_lock lock(mutex_);
    const auto found = poses_.find(scan.stamp_ns);
    return found == poses_.end() ? std::nullopt : std::optional(found->second);
  }

  /// Whether the server has the scan where it was taken.
  [[nodiscard]] bool is_right(const simulation::Simulation& simulation, int k,
                              const Eigen::Isometry3d& T_map_city) {
    const simulation::SimulatedScan scan = tomorrow(simulation, k);
    const auto T_map_lidar = pose_of(scan);
    if (!T_map_lidar) return false;
    const Eigen::Isometry3d off = (T_map_city * scan.T_map_lidar).inverse() * *T_map_lidar;
    return off.translation().norm() < 0.4 &&
           Eigen::AngleAxisd(off.linear()).angle() < 1.5 * std::numbers::pi / 180.0;
  }

  void expect_file_unchanged() {
    server_->send(SIGTERM);
    ASSERT_EQ(server_->wait_for_exit(patience), 0);
    const SavedMap after = open_map_file(setup_.map_file())->load();
    EXPECT_EQ(after.trajectory.size(), before_.trajectory.size());
    ASSERT_EQ(after.view.tiles.size(), before_.view.tiles.size());
    for (std::size_t i = 0; i < after.view.tiles.size(); ++i)
      EXPECT_EQ(after.view.tiles[i]->info.content_hash, before_.view.tiles[i]->info.content_hash);
  }

  static std::unique_ptr<ScratchFolder> folder_;
  ServiceSetup setup_;
  SavedMap before_;
  std::optional<ServerProcess> server_;
  std::optional<Client> client_;
  std::optional<ScanPublisher> publisher_;
  std::optional<dds::Participant> participant_;
  std::optional<dds::Writer<PoseWithCovarianceStamped>> operator_;
  /// Somebody said where the robot is.
  bool is_guessed_ = false;
  std::mutex mutex_;
  std::map<std::int64_t, Eigen::Isometry3d> poses_;
  Subscription odometry_;
};

std::unique_ptr<ScratchFolder> Relocation::folder_;

/// The mapped yard begins at the first day's first scan.
Eigen::Isometry3d T_yard_city() {
  return simulation::Simulation(yard(1, 0)).scan(0).T_map_lidar.inverse();
}

/// Where the second one of yard_twice() is.
Eigen::Isometry3d T_twice_city() {
  return Eigen::Isometry3d(Eigen::Translation3d(second_yard_m(), 0.0, 0.0));
}

PoseWithCovarianceStamped as_rviz(const Eigen::Isometry3d& T_map_base,
                                  const std::string& frame = "map") {
  PoseWithCovarianceStamped message;
  message.header().frame_id(frame);
  message.pose().pose(wire::to_pose(T_map_base));
  message.pose().covariance()[0] = 4.0;
  message.pose().covariance()[7] = 4.0;
  message.pose().covariance()[35] = 0.0685;
  return message;
}

TEST_F(Relocation, ARobotThatWasCarriedOffIsFoundInTheWholeMap) {
  const simulation::Simulation today(yard(1, 1));
  ASSERT_GT((today.scan(elsewhere).T_map_lidar.translation() -
             simulation::Simulation(yard(1, 0)).scan(mapped_scans - 1).T_map_lidar.translation())
                .norm(),
            60.0);
  start();
  const int next = drive_until(today, elsewhere, 40, [&] {
    const dds::ServerStatus status = client_->status();
    if (status.counter("places_found") == 0) {
      // Nothing of what it sees enters the map before.
      EXPECT_EQ(status.voxel_count, before_.view.tiles.voxel_count());
    }
    return status.counter("places_found") > 0;
  });
  ASSERT_EQ(client_->status().counter("places_found"), 1U) << client_->status().reason;
  const std::uint64_t found_at = client_->status().map_version;
  drive_until(today, next, 15, [] { return false; });
  EXPECT_TRUE(eventually([&] { return pose_of(tomorrow(today, next + 14)).has_value(); }));
  for (int k = next + 3; k < next + 15; ++k) EXPECT_TRUE(is_right(today, k, T_yard_city())) << k;
  EXPECT_EQ(client_->status().health, OdometryHealth::good);
  EXPECT_TRUE(eventually([&] { return client_->status().map_version > found_at; }))
      << "mapping goes on";
}

TEST_F(Relocation, ARobotThatIsCarriedOffOnItsWayIsFoundAgain) {
  const simulation::Simulation today(yard(1, 1));
  start();
  const auto is_good = [&] { return client_->status().health == OdometryHealth::good; };
  const int placed = drive_until(today, elsewhere, 40, is_good);
  drive_until(today, placed, 15, [] { return false; });
  ASSERT_TRUE(is_good()) << client_->status().reason;
  // To the other end of the yard. Lost for three seconds, it is looked for.
  constexpr int dropped_at = elsewhere + 100;
  drive_until(today, dropped_at, 1, [] { return false; });
  EXPECT_NE(client_->status().health, OdometryHealth::good);
  const int next = drive_until(today, dropped_at + 1, 60, is_good, 31);
  ASSERT_TRUE(is_good()) << client_->status().reason;
  EXPECT_TRUE(eventually([&] { return pose_of(tomorrow(today, next - 1)).has_value(); }));
  EXPECT_TRUE(is_right(today, next - 1, T_yard_city()));
}

TEST_F(Relocation, ARobotInAnotherCityIsNotFoundAndTheMapStaysAsItWas) {
  const simulation::Simulation other_city(yard(2, 0));
  start();
  drive_until(other_city, 20, 6, [] { return false; });
  drive_until(other_city, 26, 20, [&] { return counter("places_tried") > 3; });
  const dds::ServerStatus status = client_->status();
  EXPECT_EQ(status.health, OdometryHealth::lost);
  EXPECT_EQ(status.counter("places_found"), 0U);
  EXPECT_GT(status.counter("places_tried"), 3U);
  EXPECT_THAT(status.reason, HasSubstr("looking for its place in the whole map"));
  EXPECT_THAT(status.reason, HasSubstr("scans tried, best score 0."));
  expect_file_unchanged();
}

TEST_F(Relocation, WhereSeveralPlacesFitAnOperatorSaysWhichOne) {
  const simulation::Simulation today(yard(1, 1));
  start_in_yard_twice();
  int next = drive_until(today, elsewhere, 10, [] { return false; });
  EXPECT_EQ(client_->status().health, OdometryHealth::lost);
  EXPECT_THAT(client_->status().reason, HasSubstr("ambiguous"));
  EXPECT_GT(counter("places_ambiguous"), 0U);
  const std::uint64_t version = client_->status().map_version;

  // Where it is not.
  const Eigen::Isometry3d T_wrong = T_twice_city() * today.scan((next + 120) % 240).T_map_lidar;
  say_pose(as_rviz(T_wrong));
  next = drive_until(today, next, 40, [&] { return counter("initial_poses_refused") > 0; });
  EXPECT_EQ(counter("initial_poses_refused"), 1U);
  EXPECT_EQ(counter("places_found"), 0U);
  EXPECT_EQ(client_->status().map_version, version);

  // Two metres off, and turned a little, as a hand draws it.
  const Eigen::Isometry3d T_drawn = T_twice_city() * today.scan(next).T_map_lidar *
                                    Eigen::Translation3d(2.0, -1.0, 0.0) *
                                    Eigen::AngleAxisd(0.15, Eigen::Vector3d::UnitZ());
  say_pose(as_rviz(T_drawn));
  next = drive_until(today, next, 30, [&] { return counter("places_found") > 0; });
  ASSERT_EQ(counter("places_found"), 1U) << client_->status().reason;
  is_guessed_ = false;
  drive_until(today, next, 12, [] { return false; });
  EXPECT_TRUE(eventually([&] { return pose_of(tomorrow(today, next + 11)).has_value(); }));
  for (int k = next + 3; k < next + 12; ++k) EXPECT_TRUE(is_right(today, k, T_twice_city())) << k;
  EXPECT_EQ(client_->status().health, OdometryHealth::good);
}

TEST_F(Relocation, PosesThatMakeNoSenseAreRefused) {
  start();
  const auto refused = [&](const PoseWithCovarianceStamped& message, std::uint64_t count) {
    say_pose(message);
    EXPECT_TRUE(eventually([&] { return counter("initial_poses_refused") == count; })) << count;
  };
  const PoseWithCovarianceStamped sound = as_rviz(Eigen::Isometry3d::Identity());
  PoseWithCovarianceStamped message = sound;
  message.pose().pose().position().x(std::numeric_limits<double>::quiet_NaN());
  refused(message, 1);
  message = sound;
  message.pose().covariance()[7] = -1.0;
  refused(message, 2);
  refused(as_rviz(Eigen::Isometry3d::Identity(), "odom"), 3);
  refused(as_rviz(Eigen::Isometry3d::Identity(), ""), 4);
  EXPECT_EQ(counter("initial_poses"), 0U);
  expect_file_unchanged();
}

TEST_F(Relocation, AWrongPoseDoesNotMoveARobotThatKnowsItsPlace) {
  const simulation::Simulation today(yard(1, 1));
  start();
  int next = drive_until(today, mapped_scans, 30,
                         [&] { return client_->status().health == OdometryHealth::good; });
  ASSERT_EQ(client_->status().health, OdometryHealth::good) << client_->status().reason;
  const std::uint64_t found = counter("places_found");
  say_pose(as_rviz(T_yard_city() * today.scan(elsewhere).T_map_lidar));
  next = drive_until(today, next, 30, [&] { return counter("initial_poses_refused") > 0; });
  EXPECT_EQ(counter("initial_poses_refused"), 1U);
  EXPECT_EQ(counter("places_found"), found);
  EXPECT_TRUE(eventually([&] { return pose_of(tomorrow(today, next - 1)).has_value(); }));
  EXPECT_TRUE(is_right(today, next - 1, T_yard_city()));
}

TEST_F(Relocation, TheServiceSaysWhereTheLastScanIsAndChangesNothingUnlessItIsApplied) {
  const simulation::Simulation today(yard(1, 1));
  start_in_yard_twice();
  EXPECT_THROW(static_cast<void>(client_->localize()), ServiceError) << "there is no scan yet";
  int next = drive_until(today, elsewhere, 4, [] { return false; });
  EXPECT_EQ(client_->localize().outcome, LocalizationStatus::ambiguous);

  LocalizationQuestion near{
      .guess = PlaceGuess{.T_map_base = T_twice_city() * today.scan(next - 1).T_map_lidar,
                          .radius_m = 15.0}};
  const LocalizationAnswer answer = client_->localize(near);
  ASSERT_EQ(answer.outcome, LocalizationStatus::found);
  EXPECT_FALSE(answer.applied);
  EXPECT_GT(answer.score, 0.48);
  EXPECT_GT(answer.milliseconds, 0.0);
  const Eigen::Isometry3d T_true = T_twice_city() * today.scan(next - 1).T_map_lidar;
  EXPECT_LT((answer.T_map_base.translation() - T_true.translation()).norm(), 1.5);
  near.guess->T_map_base.translation().x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(static_cast<void>(client_->localize(near)), ServiceError);
  next = drive_until(today, next, 5, [] { return false; });
  EXPECT_EQ(counter("places_found"), 0U);

  near.guess->T_map_base = T_twice_city() * today.scan(next - 1).T_map_lidar;
  near.apply = true;
  EXPECT_TRUE(client_->localize(near).applied);
  is_guessed_ = true;
  next = drive_until(today, next, 30, [&] { return counter("places_found") > 0; });
  ASSERT_EQ(counter("places_found"), 1U);
  is_guessed_ = false;
  drive_until(today, next, 8, [] { return false; });
  EXPECT_TRUE(eventually([&] { return pose_of(tomorrow(today, next + 7)).has_value(); }));
  EXPECT_TRUE(is_right(today, next + 7, T_twice_city()));
}

TEST_F(Relocation, TheServiceFindsTheRobotInTheMapOfThisRun) {
  const simulation::Simulation today(yard(1, 1));
  start_server();
  const int next = drive_until(today, 0, 15, [] { return false; });
  const LocalizationAnswer answer = client_->localize();
  ASSERT_EQ(answer.outcome, LocalizationStatus::found) << answer.score;
  EXPECT_LT((answer.T_map_base.translation() -
             (today.scan(0).T_map_lidar.inverse() * today.scan(next - 1).T_map_lidar).translation())
                .norm(),
            1.5);
  EXPECT_FALSE(answer.applied);
}

}  // namespace
}  // namespace stillmap::test
