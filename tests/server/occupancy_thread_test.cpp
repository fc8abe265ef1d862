#include "server/occupancy/occupancy_thread.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <condition_variable>
#include <future>
#include <mutex>
#include <optional>
#include <random>
#include <thread>

#include "idl/dds/participant.hpp"
#include "idl/dds/reader.hpp"
#include "server/occupancy/occupancy.hpp"
#include "tests/eventually.hpp"
#include "tests/idl/dds_fixture.hpp"
#include "tests/server/room_scans.hpp"

namespace stillmap::test {
namespace {

using namespace std::chrono_literals;

// Else it would wait for gaps in what other tests do on this machine.
constexpr auto scheduling = server::BackgroundScheduling::normal;

server::OccupancyScan room(int index) {
  auto labelled = std::make_shared<LabelledScan>();
  labelled->scan = room_scan(index);
  labelled->motion.resize(labelled->scan.size());
  return {labelled, room_pose(index).T_map_lidar, true};
}

std::uint64_t counted(const server::Statistics& statistics, const char* event) {
  dds::ServerStatus status;
  statistics.report_to(status);
  return status.counter(event);
}

class OccupancyThreadTest : public testing::Test {
 protected:
  /// Waits until the thread has done so many jobs.
  [[nodiscard]] static bool done(const server::OccupancyThread& thread, std::uint64_t jobs) {
    return eventually([&] { return thread.changes() >= jobs; }) && thread.changes() == jobs;
  }
  [[nodiscard]] static BoxOccupancy all_of(const server::OccupancyThread& thread) {
    const Eigen::Vector3d far = Eigen::Vector3d::Constant(500.0);
    OccupancyQuery query;
    query.boxes_map.emplace_back(-far, far);
    query.max_voxels = 0;
    return thread.answer(query).boxes.at(0);
  }
  server::Statistics statistics_;
};

TEST_F(OccupancyThreadTest, MakesWhatTheMapWouldMake) {
  server::OccupancyThread thread(OccupancyServiceConfig{}, statistics_, {}, scheduling);
  OccupancyMap map(OccupancyConfig{});
  for (int i = 0; i < 4; ++i) {
    const server::OccupancyScan scan = room(i);
    map.insert(*scan.labelled, scan.T_map_lidar);
    thread.add(scan);
    ASSERT_TRUE(done(thread, static_cast<std::uint64_t>(i) + 1));
  }
  const server::EncodedOctree octree = thread.encode(OctomapEncoding::full);
  EXPECT_EQ(octree.data.bytes, map.encode(OctomapEncoding::full).bytes);
  EXPECT_EQ(octree.stamp_ns, room_scan(3).stamp_ns);
  EXPECT_EQ(counted(statistics_, "occupancy_not_cleared"), 0U);
}

TEST_F(OccupancyThreadTest, EncodesInTheBackgroundWhatItEncodesAtOnce) {
  server::OccupancyThread thread(OccupancyServiceConfig{}, statistics_, {}, scheduling);
  thread.add(room(0));
  ASSERT_TRUE(done(thread, 1));
  for (int i = 0; i < 2; ++i) {
    std::future<server::EncodedOctree> encoded = thread.encode_in_background();
    ASSERT_EQ(encoded.wait_for(patience), std::future_status::ready);
    const server::EncodedOctree octree = encoded.get();
    EXPECT_EQ(octree.data.encoding, OctomapEncoding::binary);
    EXPECT_EQ(octree.data.bytes, thread.encode(OctomapEncoding::binary).data.bytes);
    EXPECT_EQ(octree.stamp_ns, room_scan(0).stamp_ns);
  }
}

/// Holds the thread up where it calls the throttle.
class GatedOccupancyThreadTest : public OccupancyThreadTest {
 protected:
  ThrottleCallback gate() {
    return [this] {
      std::unique_lock lock(gate_mutex_);
      is_waiting_ = !is_open_;
      gate_changed_.notify_all();
      gate_changed_.wait(lock, [this] { return is_open_; });
      is_waiting_ = false;
    };
  }
  [[nodiscard]] bool waits() {
    std::unique_lock lock(gate_mutex_);
    return gate_changed_.wait_for(lock, patience, [this] { return is_waiting_; });
  }
  void set_open(bool is_open) {
    const std::scoped_lock lock(gate_mutex_);
    is_open_ = is_open;
    gate_changed_.notify_all();
  }

 private:
  std::mutex gate_mutex_;
  std::condition_variable gate_changed_;
  bool is_open_ = true;
  bool is_waiting_ = false;
};

TEST_F(GatedOccupancyThreadTest, WaitsForGapsBetweenScansAndTakesThemThen) {
  server::OccupancyThread thread(OccupancyServiceConfig{}, statistics_, gate(), scheduling);
  set_open(false);
  for (int i = 0; i < 4; ++i) thread.add(room(i));
  ASSERT_TRUE(waits());
  EXPECT_EQ(thread.changes(), 0U);
  EXPECT_EQ(all_of(thread).occupied, 0U) << "queries do not wait for the throttle";
  set_open(true);
  EXPECT_TRUE(done(thread, 4));
  EXPECT_GT(all_of(thread).occupied, 100U);
}

TEST_F(GatedOccupancyThreadTest, EncodesInAGap) {
  server::OccupancyThread thread(OccupancyServiceConfig{}, statistics_, gate(), scheduling);
  thread.add(room(0));
  ASSERT_TRUE(done(thread, 1));
  set_open(false);
  std::future<server::EncodedOctree> encoded = thread.encode_in_background();
  ASSERT_TRUE(waits());
  EXPECT_EQ(encoded.wait_for(0s), std::future_status::timeout);
  set_open(true);
  EXPECT_EQ(encoded.wait_for(patience), std::future_status::ready);
}

/// A map of one scan.
std::shared_ptr<const MapSnapshot> map_of_a_room() {
  StaticMap map{StaticMapConfig{}};
  const server::OccupancyScan scan = room(0);
  map.insert(*scan.labelled, scan.T_map_lidar);
  return map.view();
}

/// Asked while the octree of a map that has just begun cannot be made.
class BegunOccupancyThreadTest : public GatedOccupancyThreadTest {
 protected:
  std::future<BoxOccupancy> asked_as_it_begins(server::OccupancyThread& thread) {
    set_open(false);
    thread.begin(map_of_a_room());
    EXPECT_TRUE(waits());
    return std::async(std::launch::async, [&thread] { return all_of(thread); });
  }
};

TEST_F(BegunOccupancyThreadTest, WaitsForTheOctreeOfAMapThatBeginsWithVoxels) {
  server::OccupancyThread thread(OccupancyServiceConfig{}, statistics_, gate(), scheduling);
  std::future<BoxOccupancy> asked = asked_as_it_begins(thread);
  EXPECT_EQ(asked.wait_for(100ms), std::future_status::timeout) << "nothing known is no answer";
  set_open(true);
  EXPECT_GT(asked.get().occupied, 100U);
  EXPECT_FALSE(thread.encode(OctomapEncoding::binary).data.bytes.empty());
}

// By a thread that answers requests one after the other.
TEST_F(GatedOccupancyThreadTest, RefusesAllWhoAskForAnOctreeThatIsNotMadeWithinOneWait) {
  server::OccupancyThread thread(OccupancyServiceConfig{}, statistics_, gate(), scheduling);
  set_open(false);
  const auto began = std::chrono::steady_clock::now();
  thread.begin(map_of_a_room());
  ASSERT_TRUE(waits());
  EXPECT_THROW(static_cast<void>(all_of(thread)), server::OctreeNotMade);
  EXPECT_GE(std::chrono::steady_clock::now() - began, server::OccupancyThread::longest_wait);
  EXPECT_THROW(static_cast<void>(thread.encode(OctomapEncoding::binary)), server::OctreeNotMade);
  EXPECT_THROW(static_cast<void>(all_of(thread)), server::OctreeNotMade);
  EXPECT_LT(std::chrono::steady_clock::now() - began, 2 * server::OccupancyThread::longest_wait);
  set_open(true);
  EXPECT_TRUE(eventually([&] { return thread.changes() > 0; }));
  EXPECT_GT(all_of(thread).occupied, 100U);
}

TEST_F(BegunOccupancyThreadTest, AnEmptyMapThatBeginsIsAnsweredFromAtOnce) {
  server::OccupancyThread thread(OccupancyServiceConfig{}, statistics_, gate(), scheduling);
  std::future<BoxOccupancy> asked = asked_as_it_begins(thread);
  EXPECT_EQ(asked.wait_for(100ms), std::future_status::timeout);
  thread.begin(StaticMap{StaticMapConfig{}}.view());
  EXPECT_EQ(asked.wait_for(1s), std::future_status::ready);
  EXPECT_EQ(asked.get().occupied, 0U);
  set_open(true);
}

TEST_F(GatedOccupancyThreadTest, ShowsNothingOfTheOldMapWhileANewOneWaitsForAGap) {
  server::OccupancyThread thread(OccupancyServiceConfig{}, statistics_, gate(), scheduling);
  thread.add(room(0));
  ASSERT_TRUE(done(thread, 1));
  set_open(false);
  StaticMap map{StaticMapConfig{}};
  thread.begin(map.view());
  ASSERT_TRUE(waits());
  EXPECT_EQ(all_of(thread).occupied, 0U);
  EXPECT_EQ(thread.encode(OctomapEncoding::binary).data.bytes,
            OccupancyMap(OccupancyConfig{}).encode(OctomapEncoding::binary).bytes);
  set_open(true);
  EXPECT_TRUE(done(thread, 2));
  EXPECT_EQ(all_of(thread).occupied, 0U);
}

TEST_F(GatedOccupancyThreadTest, EndsWithAnEncodingUnderWay) {
  std::future<server::EncodedOctree> encoded;
  {
    server::OccupancyThread thread(OccupancyServiceConfig{}, statistics_, gate(), scheduling);
    set_open(false);
    encoded = thread.encode_in_background();
    ASSERT_TRUE(waits());
    set_open(true);
  }
  EXPECT_EQ(encoded.wait_for(0s), std::future_status::ready) << "with an octree or an exception";
}

TEST_F(GatedOccupancyThreadTest, NoOctreeOfAnOldMapIsPublishedWhileAnotherIsEncoded) {
  server::OccupancyThread thread(OccupancyServiceConfig{}, statistics_, gate(), scheduling);
  dds::Participant participant(dds::loopback(false));
  const auto topics = dds::Topics::in("stillmap");
  ServerConfig config;
  config.occupancy.publish_period_s = 1.0;
  server::OctomapPublisher publisher(participant, topics, config, thread);
  dds::Reader<octomap_msgs::msg::Octomap> early(participant, topics.octomap.dds_name,
                                                topics.octomap.reader);
  octomap_msgs::msg::Octomap octree;
  thread.add(room(0));
  ASSERT_TRUE(early.take(octree, {}, patience));
  // The octree changed, and its next encoding waits.
  thread.add(room(1));
  ASSERT_TRUE(done(thread, 2));
  set_open(false);
  thread.add(room(2));
  ASSERT_TRUE(waits());
  std::this_thread::sleep_for(1500ms);
  StaticMap map{StaticMapConfig{}};
  thread.begin(map.view());
  // As soon as it is withdrawn.
  std::optional<dds::Reader<octomap_msgs::msg::Octomap>> late;
  EXPECT_TRUE(eventually([&] {
    late.emplace(participant, topics.octomap.dds_name, topics.octomap.reader);
    return late->events().wait_for_writer(patience) && !late->take(octree, {}, 1000ms);
  })) << "of a map that is no more";
  set_open(true);
  ASSERT_TRUE(late->take(octree, {}, patience));
  EXPECT_EQ(octree.data().size(),
            OccupancyMap(OccupancyConfig{}).encode(OctomapEncoding::binary).bytes.size());
}

TEST_F(OccupancyThreadTest, TakesEveryScanWholeWhereEachCounts) {
  OccupancyServiceConfig config;
  config.queue_length = 2;
  server::OccupancyThread thread(config, statistics_, {}, scheduling, DeliveryMode::every);
  OccupancyMap map(OccupancyConfig{});
  constexpr int scans = 40;
  for (int i = 0; i < scans; ++i) {
    const server::OccupancyScan scan = room(i % 8);
    map.insert(*scan.labelled, scan.T_map_lidar);
    thread.add(scan);
  }
  ASSERT_TRUE(done(thread, scans));
  EXPECT_EQ(counted(statistics_, "occupancy_scans_dropped"), 0U);
  EXPECT_EQ(counted(statistics_, "occupancy_not_cleared"), 0U);
  EXPECT_EQ(thread.encode(OctomapEncoding::full).data.bytes,
            map.encode(OctomapEncoding::full).bytes);
}

/// Of `points` all round, 20 m away.
server::OccupancyScan wide_view(int points) {
  std::mt19937 random(1);
  std::normal_distribution<float> any;
  auto labelled = std::make_shared<LabelledScan>();
  for (int i = 0; i < points; ++i) {
    const Eigen::Vector3f direction(any(random), any(random), any(random));
    labelled->scan.points_lidar.emplace_back(20.0F * direction.normalized());
  }
  labelled->motion.resize(labelled->scan.size());
  return {labelled, Eigen::Isometry3d::Identity(), true};
}

TEST_F(OccupancyThreadTest, NoScanWaitsForAnAnswerToEnd) {
  using Clock = std::chrono::steady_clock;
  OccupancyServiceConfig config;
  config.map.resolution_m = 0.05;
  server::OccupancyThread thread(config, statistics_, {}, scheduling, DeliveryMode::every);
  thread.add(wide_view(4000));
  ASSERT_TRUE(done(thread, 1));
  auto began = Clock::now();
  EXPECT_FALSE(thread.encode(OctomapEncoding::full).data.bytes.empty());
  const auto answer_took = Clock::now() - began;
  const std::jthread client([&](const std::stop_token& stop) {
    while (!stop.stop_requested()) static_cast<void>(thread.encode(OctomapEncoding::full));
  });
  Clock::duration longest{};
  for (std::uint64_t scans = 2; scans < 12; ++scans) {
    began = Clock::now();
    thread.add(wide_view(1));
    while (thread.changes() < scans) std::this_thread::sleep_for(1ms);
    longest = std::max(longest, Clock::now() - began);
  }
  // Each wants the octree twice: a few milliseconds.
  EXPECT_LT(longest, answer_took / 2)
      << std::chrono::duration<double, std::milli>(longest).count() << " ms";
  RecordProperty("answer_ms", std::to_string(answer_took / 1ms));
  RecordProperty("longest_wait_ms", std::to_string(longest / 1ms));
}

TEST_F(OccupancyThreadTest, NobodyWaitsForRoomWhenTheServerEnds) {
  OccupancyServiceConfig config;
  config.queue_length = 1;
  std::promise<void> opened;
  const auto throttle = [gate = opened.get_future().share()] { gate.wait(); };
  server::OccupancyThread thread(config, statistics_, throttle, scheduling, DeliveryMode::every);
  std::atomic<bool> has_added = false;
  const std::jthread mapper([&] {
    for (int i = 0; i < 3; ++i) thread.add(room(i));
    has_added = true;
  });
  EXPECT_FALSE(eventually([&] { return has_added.load(); }, 500ms));
  const auto began = std::chrono::steady_clock::now();
  thread.release();
  EXPECT_TRUE(eventually([&] { return has_added.load(); }));
  EXPECT_LT(std::chrono::steady_clock::now() - began,
            server::OccupancyThread::longest_back_pressure / 2);
  opened.set_value();
}

TEST_F(OccupancyThreadTest, StopsClearingAndThenDropsScansWhenItCannotKeepUp) {
  OccupancyServiceConfig config;
  config.queue_length = 4;
  server::OccupancyThread thread(config, statistics_, {}, scheduling);
  const server::OccupancyScan scan = room(0);
  constexpr std::uint64_t scans = 400;
  for (std::uint64_t i = 0; i < scans; ++i) thread.add(scan);
  const std::uint64_t dropped = counted(statistics_, "occupancy_scans_dropped");
  EXPECT_GT(dropped, 0U);
  ASSERT_TRUE(done(thread, scans - dropped));
  EXPECT_GT(counted(statistics_, "occupancy_not_cleared"), 0U);
  EXPECT_GT(all_of(thread).occupied, 100U);
}

TEST_F(OccupancyThreadTest, BeginsAnotherMapWithItsViewAndForgetsScansOfTheOldOne) {
  server::OccupancyThread thread(OccupancyServiceConfig{}, statistics_, {}, scheduling);
  thread.add(room(0));
  ASSERT_TRUE(done(thread, 1));
  EXPECT_GT(all_of(thread).free, 100U);

  StaticMap map{StaticMapConfig{}};
  map.insert(*room(5).labelled, room_pose(5).T_map_lidar);
  const auto view = map.view();
  const std::uint64_t voxels = view->tiles.voxel_count();
  ASSERT_GT(voxels, 0U);
  thread.begin(view);
  ASSERT_TRUE(done(thread, 2));
  EXPECT_EQ(all_of(thread).occupied, voxels);
  EXPECT_EQ(all_of(thread).free, 0U);
}

}  // namespace
}  // namespace stillmap::test
