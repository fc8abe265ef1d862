#include <gtest/gtest.h>

#include <thread>

#include "server/threads/bounded_queue.hpp"

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;

QueuedScan scan_at(std::int64_t stamp_ns) {
  QueuedScan queued;
  queued.scan.stamp_ns = stamp_ns;
  return queued;
}

TEST(ScanQueue, GivesScansBackInOrder) {
  ScanQueue queue(3);
  for (std::int64_t i = 0; i < 3; ++i) EXPECT_EQ(queue.push_dropping_oldest(scan_at(i)), 0U);
  for (std::int64_t i = 0; i < 3; ++i) EXPECT_EQ(queue.pop({}, 0ms)->scan.stamp_ns, i);
  EXPECT_FALSE(queue.pop({}, 0ms));
}

TEST(ScanQueue, DropsTheOldestAndSaysSo) {
  ScanQueue queue(2);
  EXPECT_EQ(queue.push_dropping_oldest(scan_at(1)), 0U);
  EXPECT_EQ(queue.push_dropping_oldest(scan_at(2)), 0U);
  EXPECT_EQ(queue.push_dropping_oldest(scan_at(3)), 1U);
  EXPECT_EQ(queue.pop({}, 0ms)->scan.stamp_ns, 2);
  EXPECT_EQ(queue.pop({}, 0ms)->scan.stamp_ns, 3);
}

TEST(ScanQueue, LetsAPatientSenderWaitForRoom) {
  ScanQueue queue(1);
  constexpr std::int64_t scans = 200;
  const std::jthread sender([&] {
    for (std::int64_t i = 0; i < scans; ++i) EXPECT_TRUE(queue.push_blocking(scan_at(i), {}));
  });
  for (std::int64_t i = 0; i < scans; ++i) {
    const auto scan = queue.pop({}, 10s);
    ASSERT_TRUE(scan);
    EXPECT_EQ(scan->scan.stamp_ns, i);
  }
}

TEST(ScanQueue, StopsWaitingWhenAsked) {
  ScanQueue queue(1);
  queue.push_dropping_oldest(scan_at(1));
  std::stop_source stop;
  const std::jthread stopper([&] {
    std::this_thread::sleep_for(20ms);
    stop.request_stop();
  });
  EXPECT_FALSE(queue.push_blocking(scan_at(2), stop.get_token()));
  ScanQueue empty(1);
  EXPECT_FALSE(empty.pop(stop.get_token(), 60s));
}

}  // namespace
}  // namespace stillmap::server
