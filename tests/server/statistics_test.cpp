#include "server/monitoring/statistics.hpp"

#include <gtest/gtest.h>

#include "server/monitoring/recent_values.hpp"

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;

TEST(LatencyWindow, GivesNearestRankPercentiles) {
  LatencyWindow window;
  // 100, 99, ... 1: the order must not matter.
  for (int i = 100; i >= 1; --i) window.add(i);
  const dds::StageLatency latency = window.summary("odometry");
  EXPECT_EQ(latency.stage, "odometry");
  EXPECT_EQ(latency.p50_ms, 50.0);
  EXPECT_EQ(latency.p99_ms, 99.0);
  EXPECT_EQ(latency.max_ms, 100.0);
  EXPECT_EQ(latency.samples, 100U);
}

TEST(LatencyWindow, ForgetsWhatIsLongAgo) {
  LatencyWindow window;
  window.add(1e6);
  for (int i = 0; i < 512; ++i) window.add(2.0);
  EXPECT_EQ(window.summary("x").max_ms, 2.0);
}

TEST(LatencyWindow, IsZeroWithoutValues) {
  EXPECT_EQ(LatencyWindow().summary("x").samples, 0U);
  EXPECT_EQ(LatencyWindow().summary("x").p99_ms, 0.0);
}

TEST(RateWindow, CountsTheLastSeconds) {
  RateWindow rate;
  const RateWindow::Clock::time_point start{};
  for (int i = 0; i < 200; ++i) rate.add(start + i * 100ms);
  EXPECT_NEAR(rate.rate_hz(start + 19'900ms), 10.0, 0.5);
  EXPECT_EQ(rate.rate_hz(start + 60s), 0.0);
}

TEST(Statistics, CountsDropsByReason) {
  Statistics statistics;
  statistics.scan_received();
  statistics.scan_received();
  statistics.scan_received();
  statistics.scans_dropped("queue_full", 2, "too fast");
  statistics.scans_dropped("empty", 1, "no points");
  statistics.scans_dropped("queue_full", 1, "too fast");
  EXPECT_EQ(statistics.last_drop(), "too fast");
  dds::ServerStatus status;
  statistics.report_to(status);
  EXPECT_EQ(status.counter("scans_received"), 3U);
  EXPECT_EQ(status.dropped("queue_full"), 3U);
  EXPECT_EQ(status.dropped("empty"), 1U);
  EXPECT_EQ(status.dropped(), 4U);
  statistics.scan_mapped(LabelProvenance::fresh);
  EXPECT_TRUE(statistics.last_drop().empty());
}

TEST(Statistics, ReportsStagesInTheOrderOfTheirFirstScan) {
  Statistics statistics;
  for (int scan = 0; scan < 2; ++scan) {
    for (const char* stage : {"queue", "prepare", "odometry"}) statistics.add_latency(stage, 1.0);
  }
  dds::ServerStatus status;
  statistics.report_to(status);
  ASSERT_EQ(status.latencies.size(), 3U);
  EXPECT_EQ(status.latencies[0].stage, "queue");
  EXPECT_EQ(status.latencies[2].stage, "odometry");
  EXPECT_EQ(status.latencies[2].samples, 2U);
}

}  // namespace
}  // namespace stillmap::server
