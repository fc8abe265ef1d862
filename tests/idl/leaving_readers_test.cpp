// Readers that leave while their writer sends: Fast DDS 2.9 deadlocks there
// (idl/dds/rtps_writer.hpp).
#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <cstdio>
#include <thread>

#include "idl/dds/reader.hpp"
#include "idl/dds/writer.hpp"
#include "tests/idl/dds_fixture.hpp"

namespace stillmap::dds {
namespace {

using namespace std::chrono_literals;
using sensor_msgs::msg::PointCloud2;
using Clock = std::chrono::steady_clock;

constexpr int readers = 150;
constexpr std::size_t cloud_bytes = 300'000;
constexpr auto stall = 15s * test::slowdown;

/// Writes clouds without a pause, on a thread of its own.
class BusyWriter {
 public:
  BusyWriter(Participant& participant, const TopicQos& qos)
      : writer_(participant, "rt/points", qos), thread_([this](const std::stop_token& stop) {
          PointCloud2 cloud = cloud_of(cloud_bytes, 1);
          while (!stop.stop_requested()) {
            if (writer_.write(cloud)) ++written_;
          }
        }) {}

  [[nodiscard]] int written() const { return written_; }

 private:
  Writer<PointCloud2> writer_;
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

void let_readers_come_and_go(const DdsOptions& options, const TopicQos& qos) {
  Participant here(options);
  BusyWriter writer(here, qos);
  Participant there(options);
  const std::stop_token never;
  PointCloud2 cloud;
  for (int i = 0; i < readers; ++i) {
    const int before = writer.written();
    Reader<PointCloud2> reader(there, "rt/points", qos);
    static_cast<void>(reader.take(cloud, never, 50ms));
    expect_progress(writer, before);
  }
}

TEST(LeavingReaders, DoNotStopAWriterThatPacesWhatItSends) {
  DdsOptions options = loopback(false);
  options.large_message_bytes_per_s = 50'000'000;
  let_readers_come_and_go(options, {.depth = 4, .large_messages = true});
}

TEST(LeavingReaders, DoNotStopAWriterThatKeepsEverySample) {
  let_readers_come_and_go(loopback(true), {.depth = 4, .keep_all = true});
}

}  // namespace
}  // namespace stillmap::dds
