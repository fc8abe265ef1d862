// What the server keeps for those who operate it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <prometheus/metric_family.h>

#include <algorithm>

#include "server/monitoring/checkpoint_log.hpp"
#include "server/monitoring/duration_histogram.hpp"
#include "server/monitoring/metrics.hpp"
#include "server/monitoring/service_log.hpp"
#include "stillmap_msgs.h"

namespace stillmap::server {
namespace {

TEST(DurationHistogram, CountsCumulativelyWithInclusiveBounds) {
  DurationHistogram histogram;
  for (const double seconds : {0.0005, 0.001, 0.3, 99.0}) histogram.add(seconds);
  EXPECT_EQ(histogram.count(), 4U);
  EXPECT_DOUBLE_EQ(histogram.sum_s(), 99.3015);
  EXPECT_EQ(histogram.count_up_to(0), 2U);
  const auto half_second = std::ranges::find(DurationHistogram::bounds_s, 0.5);
  const auto bucket = static_cast<std::size_t>(half_second - DurationHistogram::bounds_s.begin());
  EXPECT_EQ(histogram.count_up_to(bucket - 1), 2U);
  EXPECT_EQ(histogram.count_up_to(bucket), 3U);
  EXPECT_EQ(histogram.count_up_to(DurationHistogram::bounds_s.size() - 1), 3U);
}

TEST(CheckpointLog, TellsWhatWasStoredFromWhatWasNot) {
  CheckpointLog log;
  EXPECT_FALSE(log.record().last_stored);
  { const CheckpointLog::Attempt failed(log); }
  EXPECT_EQ(log.record().failures, 1U);
  EXPECT_FALSE(log.record().last_stored);
  {
    CheckpointLog::Attempt attempt(log);
    attempt.stored();
  }
  EXPECT_EQ(log.record().failures, 1U);
  EXPECT_EQ(log.record().times.count(), 1U);
  EXPECT_TRUE(log.record().last_stored);
}

TEST(ServiceLog, CountsAnswersByServiceAndCode) {
  ServiceLog log;
  const auto reset = logged(log, "stillmap/reset", [](const int& code) {
    stillmap_msgs::srv::Reset_Response reply;
    reply.status().code(static_cast<std::uint8_t>(code));
    return reply;
  });
  // A standard type has no code.
  const auto plain = logged(log, "stillmap/plain", [](const int& value) { return value; });
  for (const int code : {0, 1, 1}) EXPECT_EQ(reset(code).status().code(), code);
  EXPECT_EQ(plain(7), 7);
  const auto services = log.services();
  ASSERT_EQ(services.size(), 2U);
  EXPECT_THAT(services.at("stillmap/reset").answers,
              testing::ElementsAre(std::pair(wire::ReplyCode::ok, 1U),
                                   std::pair(wire::ReplyCode::invalid_request, 2U)));
  EXPECT_EQ(services.at("stillmap/reset").times.count(), 3U);
  EXPECT_EQ(services.at("stillmap/plain").answers.at(wire::ReplyCode::ok), 1U);
}

prometheus::MetricFamily family(const MetricsSnapshot& snapshot, const std::string& name) {
  const auto families = metric_families(snapshot);
  const auto found = std::ranges::find(families, name, &prometheus::MetricFamily::name);
  return found == families.end() ? prometheus::MetricFamily() : *found;
}

TEST(MetricFamilies, GiveDropsByReasonAndOtherEventsApart) {
  MetricsSnapshot snapshot;
  snapshot.status.counters = {{"scans_received", 9}, {"scans_mapped", 5},
                              {"map_memory_kib", 3}, {"dropped_queue_full", 3},
                              {"dropped_empty", 1},  {"occupancy_not_cleared", 2}};
  EXPECT_EQ(family(snapshot, "stillmap_scans_received_total").metric.at(0).counter.value, 9.0);
  const auto drops = family(snapshot, "stillmap_scans_dropped_total").metric;
  ASSERT_EQ(drops.size(), 2U);
  EXPECT_EQ(drops[0].label.at(0).value, "queue_full");
  EXPECT_EQ(drops[0].counter.value, 3.0);
  const auto events = family(snapshot, "stillmap_events_total").metric;
  ASSERT_EQ(events.size(), 1U);
  EXPECT_EQ(events[0].label.at(0).value, "occupancy_not_cleared");
}

TEST(MetricFamilies, KeepPrometheusConventions) {
  const auto families = metric_families({.status = {},
                                         .stages = {},
                                         .services = {},
                                         .checkpoints = {},
                                         .map_memory = {},
                                         .process = process_use()});
  std::vector<std::string> names;
  for (const auto& one : families) {
    names.push_back(one.name);
    EXPECT_EQ(one.name.ends_with("_total"), one.type == prometheus::MetricType::Counter)
        << one.name;
    EXPECT_THAT(one.name, testing::MatchesRegex("[a-z][a-z0-9_]*"));
    EXPECT_THAT(one.name, testing::Not(testing::ContainsRegex("_(ms|kib|mib|percent)$")));
    EXPECT_FALSE(one.help.empty()) << one.name;
  }
  std::ranges::sort(names);
  EXPECT_EQ(std::ranges::adjacent_find(names), names.end());
}

TEST(ProcessUse, IsThatOfThisProcess) {
  const ProcessUse use = process_use();
  EXPECT_GT(use.resident_bytes, 1e6);
  EXPECT_GE(use.open_files, 3.0);
  EXPECT_GE(use.cpu_seconds, 0.0);
}

}  // namespace
}  // namespace stillmap::server
