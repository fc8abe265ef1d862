// The mapping thread with a network that cannot keep the sensor's rate.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "server/mapping/mapping_thread.hpp"
#include "server/publishers/status_publisher.hpp"
#include "tests/eventually.hpp"
#include "tests/server/room_scans.hpp"
#include "tests/server/slow_segmenter.hpp"

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using Clock = std::chrono::steady_clock;

// Of the sensor, ten times a second; the network's times are in proportion.
constexpr auto period = 100ms * test::slowdown;
constexpr int period_ms = 100 * test::slowdown;

ServerConfig live_config() {
  ServerConfig config;
  config.mapper.sensor = vlp_16();
  config.labels.source = LabelProvider::model;
  config.labels.budget_ms = 3 * period_ms / 10;
  config.input.queue_length = 20;
  return config;
}

class SlowSegmentation : public testing::Test {
 protected:
  /// Sends a scan a period, as a sensor does, and waits until they are worked off.
  void drive(int scans) {
    auto due = Clock::now();
    for (int k = 0; k < scans; ++k, due += period) {
      std::this_thread::sleep_until(due);
      send();
    }
    work_off();
  }
  /// The same at that rate or as fast as the machine is: no scan waits behind another one.
  void drive_one_by_one(int scans) {
    for (int k = 0; k < scans; ++k) {
      const auto due = Clock::now() + period;
      send();
      work_off();
      std::this_thread::sleep_until(due);
    }
  }
  /// As many as it takes, which are more on a busy machine.
  [[nodiscard]] bool drives_until(const std::function<bool(const dds::ServerStatus&)>& holds) {
    const auto deadline = Clock::now() + test::patience;
    while (!holds(status())) {
      if (Clock::now() > deadline) return false;
      drive_one_by_one(1);
    }
    return true;
  }
  void send() {
    statistics_.scan_received();
    queue_.push_dropping_oldest({test::room_scan(next_scan_++), "lidar", Clock::now()});
  }
  void work_off() const {
    EXPECT_TRUE(test::eventually([this] {
      const dds::ServerStatus now = status();
      return now.counter("scans_mapped") + now.dropped() >= static_cast<std::uint64_t>(next_scan_);
    }));
  }
  [[nodiscard]] dds::ServerStatus status() const {
    return ServerReport(
               {.label_source = "slow", .points_topic = {}, .host_diagnostics = {}}, latest_map_,
               statistics_, [] { return std::vector<dds::Diagnostic>(); },
               [] { return std::string(); })
        .status();
  }
  [[nodiscard]] double median_ms(const std::string& stage) const {
    for (const dds::StageLatency& latency : status().latencies) {
      if (latency.stage == stage) return latency.p50_ms;
    }
    ADD_FAILURE() << "no stage " << stage;
    return 0.0;
  }

  test::SlowSegmenter::Behaviour source_;
  ScanQueue queue_{20};
  Statistics statistics_;
  LatestMap latest_map_;
  int next_scan_ = 0;
};

TEST_F(SlowSegmentation, DelaysNoPoseBeyondTheBudgetAndIsUsedForEveryNthScan) {
  source_.delay_ms = 2 * period_ms;
  MappingThread mapping(live_config(), std::make_unique<test::SlowSegmenter>(source_), std::nullopt,
                        nullptr, queue_, statistics_, latest_map_, {});
  drive(30);
  const dds::ServerStatus slow = status();
  EXPECT_EQ(slow.counter("scans_mapped"), 30U);
  EXPECT_GE(slow.segmentation.interval, 2U);
  EXPECT_GE(slow.segmentation.inference_ms, 1.99 * period_ms);
  EXPECT_EQ(slow.segmentation.fresh_share, 0.0);
  EXPECT_GT(slow.segmentation.propagated_share, 0.6);
  EXPECT_THAT(slow.reason, HasSubstr(dds::every_nth_scan(slow.segmentation.interval)));
  EXPECT_THAT(slow.reason, HasSubstr("labels are propagated between"));
  // The network's two periods do not show: the budget of 0.3, and much room for a busy machine.
  EXPECT_LT(median_ms("segment"), 1.9 * period_ms);

  source_.delay_ms = 0;
  EXPECT_TRUE(drives_until([](const dds::ServerStatus& fast) {
    return fast.segmentation.interval == 1U && fast.segmentation.fresh_share > 0.0 &&
           fast.reason.empty();
  })) << status().reason;
}

TEST_F(SlowSegmentation, LooksMoreCoarselyBeforeScansAreLeftOut) {
  source_.delay_ms = 3 * period_ms / 2;
  source_.costs = {1.0, 0.3};
  MappingThread mapping(live_config(), std::make_unique<test::SlowSegmenter>(source_), std::nullopt,
                        nullptr, queue_, statistics_, latest_map_, {});
  drive(20);
  const dds::ServerStatus slow = status();
  EXPECT_EQ(slow.segmentation.image_columns, 600U);
  EXPECT_EQ(slow.segmentation.full_columns, 2000U);
  EXPECT_LT(slow.segmentation.inference_ms, 1.5 * period_ms);
  EXPECT_THAT(slow.reason, HasSubstr("600 columns wide instead of 2000"));

  source_.delay_ms = 0;
  EXPECT_TRUE(drives_until([](const dds::ServerStatus& fast) {
    return fast.segmentation.image_columns == 2000U && fast.reason.empty();
  })) << status().reason;
}

TEST_F(SlowSegmentation, ThatFailsLeavesPosesAndMap) {
  source_.fails = true;
  // None is put off, and none is mapped before its labels, however slow the machine is.
  ServerConfig patient = live_config();
  patient.labels.budget_ms = 60'000;
  MappingThread mapping(patient, std::make_unique<test::SlowSegmenter>(source_), std::nullopt,
                        nullptr, queue_, statistics_, latest_map_, {});
  drive_one_by_one(8);
  const dds::ServerStatus failing = status();
  EXPECT_EQ(failing.counter("scans_mapped"), 8U);
  EXPECT_EQ(failing.counter("label_failures"), 8U);
  EXPECT_EQ(failing.segmentation.unlabelled_share, 1.0);
  EXPECT_EQ(failing.label_source, "none");
  EXPECT_THAT(failing.reason, HasSubstr("the network is broken"));
  source_.fails = false;
  drive_one_by_one(3);
  EXPECT_EQ(status().reason, "");
  EXPECT_EQ(latest_map_.trajectory().size(), 11U);
}

TEST_F(SlowSegmentation, DoesNotHoldUpTheEnd) {
  source_.delay_ms = 10 * period_ms;
  auto mapping = std::make_unique<MappingThread>(
      live_config(), std::make_unique<test::SlowSegmenter>(source_), std::nullopt, nullptr, queue_,
      statistics_, latest_map_, MappingOutputs{});
  drive(2);
  const auto began = Clock::now();
  mapping.reset();
  // The network ends the scan that it has in work, and begins no other one.
  EXPECT_LT(Clock::now() - began, 18 * period);
}

}  // namespace
}  // namespace stillmap::server
