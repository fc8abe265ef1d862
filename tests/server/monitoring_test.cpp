// What the server keeps for those who operate it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <prometheus/metric_family.h>

#include <algorithm>
#include <map>

#include "server/monitoring/log.hpp"
#include "server/monitoring/metrics.hpp"
#include "server/monitoring/scan_loss_window.hpp"
#include "server/monitoring/service_log.hpp"
#include "server/monitoring/statistics.hpp"
#include "stillmap_msgs.h"

namespace stillmap::server {
namespace {

using prometheus::MetricFamily;
using testing::ElementsAre;
using testing::Pair;

MetricFamily family(Metrics& metrics, const std::string& name,
                    const dds::ServerStatus& status = {}) {
  const auto families = metrics.collect(status);
  const auto found = std::ranges::find(families, name, &MetricFamily::name);
  return found == families.end() ? MetricFamily() : *found;
}

/// Values of a family of counters or gauges, by one of its labels.
std::map<std::string, double> values_by(const MetricFamily& family, const std::string& label) {
  std::map<std::string, double> values;
  for (const auto& metric : family.metric) {
    const auto found =
        std::ranges::find(metric.label, label, &prometheus::ClientMetric::Label::name);
    if (found == metric.label.end()) continue;
    values[found->value] = metric.counter.value + metric.gauge.value;
  }
  return values;
}

TEST(ServiceLog, CountsAnswersByServiceAndCode) {
  Metrics metrics;
  ServiceLog log(metrics);
  const auto reset = logged(log, "stillmap/reset", [](const int& code) {
    stillmap_msgs::srv::Reset_Response reply;
    reply.status().code(static_cast<std::uint8_t>(code));
    return reply;
  });
  for (const int code : {0, 1, 1}) EXPECT_EQ(reset(code).status().code(), code);
  EXPECT_THAT(values_by(family(metrics, "stillmap_service_requests_total"), "code"),
              ElementsAre(Pair("invalid_request", 2.0), Pair("ok", 1.0)));
  // A standard type has no code.
  const auto plain = logged(log, "stillmap/plain", [](const int& value) { return value; });
  EXPECT_EQ(plain(7), 7);
  EXPECT_EQ(
      values_by(family(metrics, "stillmap_service_requests_total"), "service").at("stillmap/plain"),
      1.0);
  const MetricFamily durations = family(metrics, "stillmap_service_duration_seconds");
  ASSERT_EQ(durations.metric.size(), 2U);
  EXPECT_EQ(durations.metric[0].histogram.sample_count + durations.metric[1].histogram.sample_count,
            4U);
}

TEST(Metrics, GiveDropsByReasonAndOtherEventsApart) {
  Statistics statistics;
  for (int scan = 0; scan < 9; ++scan) statistics.scan_received();
  statistics.scans_dropped("queue_full", 3, "too fast");
  statistics.scans_dropped("empty", 1, "no points");
  statistics.scans_dropped("bad_cloud", 2, "no field x");
  statistics.bad_cloud("no_xyz");
  statistics.bad_cloud("bad_field");
  statistics.sweep_without("rear");
  statistics.count("occupancy_not_cleared");
  Metrics& metrics = statistics.metrics();
  EXPECT_EQ(family(metrics, "stillmap_scans_received_total").metric.at(0).counter.value, 9.0);
  EXPECT_THAT(values_by(family(metrics, "stillmap_scans_dropped_total"), "reason"),
              ElementsAre(Pair("bad_cloud", 2.0), Pair("empty", 1.0), Pair("queue_full", 3.0)));
  EXPECT_THAT(values_by(family(metrics, "stillmap_bad_clouds_total"), "fault"),
              ElementsAre(Pair("bad_field", 1.0), Pair("no_xyz", 1.0)));
  EXPECT_THAT(values_by(family(metrics, "stillmap_sweeps_without_total"), "lidar"),
              ElementsAre(Pair("rear", 1.0)));
  EXPECT_THAT(values_by(family(metrics, "stillmap_events_total"), "event"),
              ElementsAre(Pair("occupancy_not_cleared", 1.0)));
}

TEST(Metrics, ShowTheFaultsOfServicesThatTheStatusHas) {
  Metrics metrics;
  dds::ServerStatus status;
  status.service_faults = {{"slow_client", "stillmap/get_tiles", 3},
                           {"unreadable_request", "stillmap/reset", 1}};
  for (const double slow : {3.0, 5.0}) {
    status.service_faults.front().count = static_cast<std::uint64_t>(slow);
    const MetricFamily faults = family(metrics, "stillmap_service_faults_total", status);
    EXPECT_THAT(values_by(faults, "service"),
                ElementsAre(Pair("stillmap/get_tiles", slow), Pair("stillmap/reset", 1.0)));
    EXPECT_THAT(values_by(faults, "fault"),
                ElementsAre(Pair("slow_client", slow), Pair("unreadable_request", 1.0)));
  }
}

TEST(Metrics, AndTheStatusHaveOneSource) {
  Statistics statistics;
  statistics.set_map_memory({.bytes = 4096, .resident_tiles = 0, .non_resident_tiles = 5}, 1);
  statistics.segmentation_failed("the network is broken");
  dds::ServerStatus status;
  statistics.report_to(status);
  EXPECT_EQ(status.counter("map_memory_kib"), 4U);
  EXPECT_EQ(status.counter("map_tiles_evicted"), 5U);
  EXPECT_EQ(status.counter("map_tiles_unreadable"), 1U);
  EXPECT_EQ(status.counter("label_failures"), 1U);
  Metrics& metrics = statistics.metrics();
  EXPECT_EQ(family(metrics, "stillmap_map_memory_bytes").metric.at(0).gauge.value, 4096.0);
  EXPECT_EQ(family(metrics, "stillmap_map_tiles_evicted").metric.at(0).gauge.value, 5.0);
  EXPECT_EQ(family(metrics, "stillmap_label_failures_total").metric.at(0).counter.value, 1.0);
}

TEST(Statistics, CountScansThatDidNotArrive) {
  Statistics statistics;
  dds::ServerStatus status;
  statistics.report_to(status);
  EXPECT_EQ(std::ranges::count(status.counters, "scans_lost", &dds::NamedCounter::name), 0);
  statistics.scans_lost(2);
  statistics.scans_lost(3);
  statistics.report_to(status);
  EXPECT_EQ(status.counter("scans_lost"), 5U);
  EXPECT_EQ(status.dropped(), 0U) << "they were never received";
  const auto metric = family(statistics.metrics(), "stillmap_scans_lost_total").metric.at(0);
  EXPECT_EQ(metric.counter.value, 5.0);
}

TEST(ScanLossWindow, TellsOfTheLastMinuteOnly) {
  using namespace std::chrono_literals;
  ScanLossWindow window;
  const ScanLossWindow::Clock::time_point start{24h};
  window.add("sound", 0, start);
  window.add("lossy", 0, start);
  window.add("lossy", 4, start + 1s);
  const auto losses = window.losses(start + 2s);
  ASSERT_EQ(losses.size(), 1U);
  EXPECT_EQ(losses[0].writer_guid, "lossy");
  EXPECT_EQ(losses[0].received, 2U);
  EXPECT_EQ(losses[0].lost, 4U);
  window.add("lossy", 0, start + 29s);
  EXPECT_EQ(window.losses(start + 31s).size(), 1U);
  window.add("lossy", 0, start + 62s);
  EXPECT_TRUE(window.losses(start + 62s).empty());
  window.add("lossy", 1, start + 63s);
  EXPECT_TRUE(window.losses(start + 200s).empty());
}

TEST(Metrics, ShowTheStatusAsItIs) {
  Metrics metrics;
  dds::ServerStatus status;
  status.health = OdometryHealth::good;
  status.label_source = "model";
  status.segmentation.fresh_share = 0.25;
  status.segmentation.propagated_share = 0.75;
  const auto health = values_by(family(metrics, "stillmap_odometry_health", status), "state");
  EXPECT_EQ(health.at("good"), 1.0);
  EXPECT_EQ(health.at("lost"), 0.0);
  EXPECT_THAT(values_by(family(metrics, "stillmap_scan_labels_ratio", status), "source"),
              ElementsAre(Pair("none", 0.0), Pair("propagated", 0.75), Pair("segmented", 0.25)));
  status.label_source = "none";
  EXPECT_THAT(values_by(family(metrics, "stillmap_info", status), "label_source"),
              ElementsAre(Pair("none", 1.0)))
      << "without the source before";
}

TEST(Metrics, KeepPrometheusConventions) {
  Statistics statistics;
  statistics.add_latency("odometry", 1.0);
  statistics.scans_dropped("queue_full", 3, "too fast");
  statistics.count("sensor_mismatch");
  ServiceLog(statistics.metrics()).answered("stillmap/reset", wire::ReplyCode::ok, 0.1);
  std::vector<std::string> names;
  for (const auto& one : statistics.metrics().collect({})) {
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

TEST(Metrics, ShowThisProcess) {
  Metrics metrics;
  EXPECT_GT(family(metrics, "process_resident_memory_bytes").metric.at(0).gauge.value, 1e6);
  EXPECT_GE(family(metrics, "process_open_fds").metric.at(0).gauge.value, 3.0);
  const double before = family(metrics, "process_cpu_seconds_total").metric.at(0).counter.value;
  EXPECT_GT(before, 0.0);
  EXPECT_GE(family(metrics, "process_cpu_seconds_total").metric.at(0).counter.value, before);
}

TEST(NewLines, AreOnceEachAndForgottenWhenThereAreMany) {
  NewLines lines;
  EXPECT_TRUE(lines.add("first"));
  EXPECT_FALSE(lines.add("first"));
  for (std::size_t i = 1; i < NewLines::max_lines; ++i) EXPECT_TRUE(lines.add(std::to_string(i)));
  EXPECT_FALSE(lines.add("first"));
  EXPECT_TRUE(lines.add("one more"));
  EXPECT_TRUE(lines.add("first"));
}

}  // namespace
}  // namespace stillmap::server
