#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <mutex>
#include <random>
#include <thread>

#include "idl/conversions/to_cloud.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "tests/server/room_scans.hpp"
#include "tests/server/server_process.hpp"

namespace stillmap::test {
namespace {

using sensor_msgs::msg::PointCloud2;
using namespace std::chrono_literals;

struct PublisherCase {
  const char* name;
  const char* delivery;
  dds::TopicQos offered;
  bool matches;
};

class ScanPublishers : public testing::TestWithParam<PublisherCase> {};

// A lidar driver, as others write it: some are reliable, some best effort ("sensor data").
TEST_P(ScanPublishers, ReachTheServerOrItSaysWhyNot) {
  const auto& [name, delivery, offered, matches] = GetParam();
  const ServiceSetup setup(delivery);
  const ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  dds::Participant participant(setup.dds());
  dds::Writer<PointCloud2> clouds(participant, "rt/points", offered);
  if (!matches) {
    EXPECT_TRUE(eventually([&] {
      return client.status().reason.find("best-effort") != std::string::npos;
    })) << client.status().reason;
    return;
  }
  ASSERT_TRUE(clouds.readers().wait_for_any(patience));
  int next = 0;
  ASSERT_TRUE(eventually([&] {
    (void)clouds.write(wire::to_cloud(room_scan(next++), {}, "lidar"));
    std::this_thread::sleep_for(100ms);
    return client.status().counter("scans_mapped") >= 5;
  }));
}

INSTANTIATE_TEST_SUITE_P(
    All, ScanPublishers,
    testing::Values(
        PublisherCase{"ReliableToLatest", "latest", {.depth = 5}, true},
        PublisherCase{"BestEffortToLatest", "latest", {.reliable = false, .depth = 5}, true},
        PublisherCase{"LatchedToLatest", "latest", {.transient_local = true, .depth = 1}, true},
        PublisherCase{"ReliableToEvery", "every", {.depth = 5}, true},
        PublisherCase{"BestEffortToEvery", "every", {.reliable = false, .depth = 5}, false}),
    [](const auto& info) { return std::string(info.param.name); });

/// The poses that come back for the first scans of the room, when `change` was done to each, and
/// `clouds_per_pose` of them have a pose.
template <typename Change>
std::map<std::int64_t, Eigen::Isometry3d> poses_with(Change change, int scans,
                                                     int clouds_per_pose = 1) {
  const ServiceSetup setup("every");
  const ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  std::mutex mutex;
  std::map<std::int64_t, Eigen::Isometry3d> poses;
  const auto subscription = client.subscribe_odometry([&](const OdometryUpdate& update) {
    const std::scoped_lock lock(mutex);
    poses.emplace(update.pose.stamp_ns, update.pose.T_map_lidar);
  });
  ScanPublisher publisher(setup.publisher(true));
  EXPECT_TRUE(publisher.wait_for_subscriber(patience));
  for (int i = 0; i < scans; ++i) {
    Scan scan = room_scan(i);
    change(scan);
    EXPECT_TRUE(publisher.publish(scan, {}, patience));
  }
  EXPECT_TRUE(eventually([&] {
    const std::scoped_lock lock(mutex);
    return poses.size() >= static_cast<std::size_t>(scans / clouds_per_pose);
  }));
  const std::scoped_lock lock(mutex);
  return poses;
}

// Livox and others number no rings and send points in no order of rings: they are found from the
// elevation by the sensor's description.
TEST(ScanWithoutRings, IsMappedByTheElevationOfItsPoints) {
  constexpr int scans = 12;
  std::mt19937 random(1);
  const auto poses = poses_with(
      [&](Scan& scan) {
        scan.ring.clear();
        scan.labels.clear();
        std::ranges::shuffle(scan.points_lidar, random);
      },
      scans);
  for (int i = 0; i < scans; ++i) {
    const StampedPose truth = room_pose(i);
    const auto pose = poses.find(truth.stamp_ns);
    ASSERT_NE(pose, poses.end()) << i;
    EXPECT_LT((pose->second.translation() - truth.T_map_lidar.translation()).norm(), 0.1) << i;
  }
}

// A simulator that ticks twice a turn of its lidar: each cloud is what one half shows at its tick.
TEST(HalfTurns, AreMappedAsWholeOnes) {
  constexpr int clouds = 24;
  int tick = 0;
  const auto poses = poses_with(
      [&](Scan& scan) {
        const bool is_left = tick++ % 2 == 0;
        Scan half;
        half.stamp_ns = scan.stamp_ns;
        for (std::size_t k = 0; k < scan.size(); ++k) {
          if ((scan.points_lidar[k].y() >= 0.0F) != is_left) continue;
          half.points_lidar.push_back(scan.points_lidar[k]);
          half.ring.push_back(scan.ring[k]);
        }
        scan = std::move(half);
      },
      clouds, 2);
  EXPECT_EQ(poses.size(), clouds / 2);
  for (int i = 0; i < clouds; i += 2) {
    const StampedPose truth = room_pose(i);
    const auto pose = poses.find(truth.stamp_ns);
    ASSERT_NE(pose, poses.end()) << i;
    EXPECT_LT((pose->second.translation() - truth.T_map_lidar.translation()).norm(), 0.05) << i;
  }
}

/// Whether that counter comes to 3 when three scans come whose points have these labels in turn.
bool counts_labels(const std::vector<std::uint32_t>& labels, const std::string& counter) {
  const ServiceSetup setup("every");
  const ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  ScanPublisher publisher(setup.publisher(true));
  EXPECT_TRUE(publisher.wait_for_subscriber(patience));
  for (int i = 0; i < 3; ++i) {
    const Scan scan = room_scan(i);
    std::vector<std::uint32_t> raw_labels(scan.size());
    for (std::size_t k = 0; k < scan.size(); ++k) raw_labels[k] = labels[k % labels.size()];
    EXPECT_TRUE(publisher.publish(scan, raw_labels, patience));
  }
  return eventually([&] { return client.status().counter(counter) == 3; });
}

TEST(LabelsOfScans, AreDoubtedWhereTheyAreClassesOrMostlyUnknown) {
  EXPECT_TRUE(counts_labels({9, 13, 15, 17, 255, (7U << 16U) | 1U}, "labels_look_like_classes"));
  EXPECT_TRUE(counts_labels({24, 26, 28, 30}, "labels_mostly_unknown"));
}

TEST(ToldLidar, CloudsOfAnotherFrameAreCounted) {
  const ServiceSetup setup("every", "save_period_s: 3600", "sensor: auto");
  const ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  ScanPublisherOptions options = setup.publisher(true);
  std::uint64_t mapped = 0;
  for (const char* frame : {"lidar", "velodyne"}) {
    options.lidar_frame = frame;
    ScanPublisher publisher(options);
    EXPECT_TRUE(publisher.wait_for_subscriber(patience));
    for (int i = 0; i < 3; ++i)
      EXPECT_TRUE(publisher.publish(room_scan(static_cast<int>(mapped++)), {}, patience));
    ASSERT_TRUE(wait_for_scans(client, mapped));
    EXPECT_EQ(client.status().counter("clouds_of_another_frame"), mapped - 3) << frame;
  }
}

/// What the status says of clouds, when so many scans came to which `change` was done. `input`: the
/// section's delivery, and what follows it.
template <typename Change>
std::vector<std::string> told_of(Change change, int scans, const std::string& more = "",
                                 const std::string& input = "every") {
  const ServiceSetup setup(input, "save_period_s: 3600", more);
  const ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  ScanPublisher publisher(setup.publisher(true));
  EXPECT_TRUE(publisher.wait_for_subscriber(patience));
  for (int i = 0; i < scans; ++i) {
    Scan scan = room_scan(0);
    scan.stamp_ns = room_pose(i).stamp_ns;
    change(scan, i);
    EXPECT_TRUE(publisher.publish(scan, {}, patience));
  }
  EXPECT_TRUE(eventually([&] {
    return client.status().counter("scans_received") == static_cast<std::uint64_t>(scans);
  }));
  std::vector<std::string> told;
  for (const dds::Diagnostic& one : client.status().diagnostics)
    told.push_back(one.what + ": " + one.hint);
  return told;
}

TEST(LiveClouds, OfOtherAxesAreToldByTheirGround) {
  constexpr int scans = 102;
  const auto upside_down = [](Scan& scan, int) {
    for (Eigen::Vector3f& p : scan.points_lidar) p = {p.x(), -p.y(), -p.z()};
  };
  using testing::AllOf, testing::Contains, testing::HasSubstr, testing::Not;
  EXPECT_THAT(told_of(upside_down, scans),
              Contains(AllOf(HasSubstr("-z is up"), HasSubstr("{y: [-y], z: [-z]}"))));
  EXPECT_THAT(told_of([](Scan&, int) {}, scans), Not(Contains(HasSubstr("is up"))));
  // Where it is known how the lidar hangs, it is right so.
  EXPECT_THAT(
      told_of(upside_down, scans,
              "frames: {base: base_link}\nmount: {xyz_m: [0, 0, 1.5], rpy_deg: [180, 0, 0]}"),
      Not(Contains(HasSubstr("is up"))));
}

TEST(LiveClouds, OfHalfTurnsThatAreNotJoinedAreToldByWhereTheyLook) {
  const auto halves = [](Scan& scan, int i) {
    for (Eigen::Vector3f& p : scan.points_lidar)
      if ((p.y() < 0.0F) == (i % 2 == 0)) p.setConstant(NAN);
  };
  EXPECT_THAT(told_of(halves, 102, "", "every, clouds_per_turn: 1"),
              testing::Contains(testing::HasSubstr("parts of one turn")));
}

TEST(LiveClouds, OfTwoPublishersInTurnsAreTold) {
  const ServiceSetup setup("every");
  const ServerProcess server(setup.server_arguments());
  Client client(setup.client());
  client.wait_for_server(patience);
  ScanPublisher robot(setup.publisher(true)), replay(setup.publisher(true));
  const auto told = [&] {
    return std::ranges::any_of(client.status().diagnostics, [](const dds::Diagnostic& one) {
      return one.what.find("2 publishers send scans in turns") != std::string::npos;
    });
  };
  int next = 0;
  const auto send = [&](ScanPublisher& publisher) {
    EXPECT_TRUE(publisher.wait_for_subscriber(patience));
    EXPECT_TRUE(publisher.publish(room_scan(next++), {}, patience));
  };
  for (int k = 0; k < 4; ++k) send(robot);
  for (int k = 0; k < 4; ++k) send(replay);
  ASSERT_TRUE(wait_for_scans(client, static_cast<std::uint64_t>(next)));
  EXPECT_FALSE(told());
  for (int k = 0; k < 4; ++k) {
    send(robot);
    ASSERT_TRUE(wait_for_scans(client, static_cast<std::uint64_t>(next)));
    send(replay);
    ASSERT_TRUE(wait_for_scans(client, static_cast<std::uint64_t>(next)));
  }
  EXPECT_TRUE(told());
}

}  // namespace
}  // namespace stillmap::test
