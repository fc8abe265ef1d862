// Readers that leave, or join, while their writer sends: Fast DDS 2.9 deadlocks there, or counts
// wrongly (idl/dds/rtps_writer.hpp).
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <functional>
#include <thread>

#include "idl/dds/reader.hpp"
#include "idl/dds/writer.hpp"
#include "stillmap_msgs.h"
#include "tests/idl/dds_fixture.hpp"

namespace stillmap::dds {
namespace {

using namespace std::chrono_literals;
using sensor_msgs::msg::PointCloud2;
using stillmap_msgs::msg::MapTile;
using Clock = std::chrono::steady_clock;

constexpr int readers = 150;
/// As many of them as come in this time: a slow machine needs a second each.
constexpr auto duration = 40s;
constexpr std::size_t cloud_bytes = 300'000;
constexpr auto stall = 15s * test::slowdown;

/// Writes without a pause, on a thread of its own; `write` gets the number of the sample, and says
/// whether that was written.
class BusyWriter {
 public:
  explicit BusyWriter(const std::function<bool(int)>& write)
      : thread_([this, write](const std::stop_token& stop) {
          while (!stop.stop_requested()) {
            if (write(written_)) ++written_;
          }
        }) {}

  [[nodiscard]] int written() const { return written_; }

 private:
  std::atomic<int> written_ = 0;
  std::jthread thread_;
};

/// A thread that is deadlocked cannot be ended: the process is.
void expect_progress(const BusyWriter& writer, int since) {
  const auto deadline = Clock::now() + stall;
  while (writer.written() == since) {
    if (Clock::now() > deadline) {
      std::fprintf(stderr, "nothing was written any more: a deadlock\n");
      ::_exit(1);
    }
    std::this_thread::sleep_for(1ms);
  }
}

template <typename T>
void let_readers_come_and_go(const DdsOptions& options, const TopicQos& qos,
                             const std::function<bool(Writer<T>&, int)>& write) {
  Participant here(options);
  Writer<T> writer(here, "rt/samples", qos);
  const BusyWriter busy([&](int number) { return write(writer, number); });
  Participant there(options);
  const std::stop_token never;
  T sample;
  const auto end = Clock::now() + duration;
  for (int i = 0; i < readers && Clock::now() < end; ++i) {
    const int before = busy.written();
    Reader<T> reader(there, "rt/samples", qos);
    static_cast<void>(reader.take(sample, never, 50ms));
    expect_progress(busy, before);
  }
}

void let_readers_of_clouds_come_and_go(const DdsOptions& options, const TopicQos& qos) {
  const PointCloud2 cloud = cloud_of(cloud_bytes, 1);
  let_readers_come_and_go<PointCloud2>(
      options, qos, [&](Writer<PointCloud2>& writer, int) { return writer.write(cloud); });
}

DdsOptions with_limited_rate() {
  DdsOptions options = loopback(false);
  options.large_message_bytes_per_s = 50'000'000;
  return options;
}

TEST(LeavingReaders, DoNotStopAWriterThatPacesWhatItSends) {
  let_readers_of_clouds_come_and_go(with_limited_rate(), {.depth = 4, .large_messages = true});
}

TEST(LeavingReaders, DoNotStopAWriterThatKeepsEverySample) {
  let_readers_of_clouds_come_and_go(loopback(true), {.depth = 4, .keep_all = true});
}

TEST(LeavingReaders, DoNotStopAWriterThatForgetsTiles) {
  constexpr int tiles = 8;
  const TopicQos qos{
      .transient_local = true, .depth = 1, .max_keys = 4 * tiles, .large_messages = true};
  let_readers_come_and_go<MapTile>(with_limited_rate(), qos,
                                   [](Writer<MapTile>& writer, int number) {
                                     MapTile tile;
                                     tile.tile_x(number);
                                     tile.index_x().assign(cloud_bytes / 20, 1);
                                     if (!writer.write(tile)) return false;
                                     tile.tile_x(number - tiles);
                                     writer.unregister(tile);
                                     return true;
                                   });
}

TEST(JoiningReaders, OfTheSameProcessDoNotFillAWriterThatKeepsEverySample) {
  DdsOptions options = loopback(false);
  hand_over_in_process();
  constexpr int depth = 4;
  const TopicQos qos{.depth = depth, .keep_all = true};
  Participant here(options);
  Writer<PointCloud2> writer(here, "rt/points", qos);
  ASSERT_TRUE(writer.write(cloud_of(100, 0)));
  Reader<PointCloud2> reader(here, "rt/points", qos);
  ASSERT_TRUE(reader.events().wait_for_writer(discovery_timeout));
  PointCloud2 got;
  for (std::uint32_t number = 1; number <= 3 * depth; ++number) {
    ASSERT_TRUE(writer.write(cloud_of(100, number))) << "sample " << number;
    ASSERT_TRUE(reader.take(got, {}, discovery_timeout));
    EXPECT_EQ(got.width(), number);
  }
  EXPECT_TRUE(writer.wait_for_acknowledgements(discovery_timeout));
}

}  // namespace
}  // namespace stillmap::dds
