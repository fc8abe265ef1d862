#include "server/mapping/async_segmenter.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <set>
#include <thread>

#include "tests/server/slow_segmenter.hpp"

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

Scan scan_at(std::int64_t stamp_ns) {
  Scan scan;
  scan.stamp_ns = stamp_ns;
  scan.points_lidar.emplace_back(1.0F, 2.0F, 3.0F);
  scan.labels.push_back(SemanticClass::road);
  return scan;
}

class AsyncSegmenterTest : public testing::Test {
 protected:
  [[nodiscard]] std::unique_ptr<AsyncSegmenter> make_segmenter(std::chrono::milliseconds budget) {
    return std::make_unique<AsyncSegmenter>(std::make_unique<test::SlowSegmenter>(source_), budget,
                                            queue_, statistics_);
  }
  [[nodiscard]] dds::ServerStatus status() const {
    dds::ServerStatus status;
    statistics_.report_to(status);
    return status;
  }

  test::SlowSegmenter::Behaviour source_;
  ScanQueue queue_{3};
  Statistics statistics_;
};

TEST_F(AsyncSegmenterTest, AFastSourceAnswersInTime) {
  const auto labels = make_segmenter(5s);
  for (int k = 0; k < 5; ++k) {
    const auto output = labels->submit(scan_at(k));
    ASSERT_EQ(output.finished.size(), 1U);
    EXPECT_EQ(output.finished[0].stamp_ns, k);
    EXPECT_EQ(output.finished[0].labels.classes[0], SemanticClass::road);
    EXPECT_FALSE(output.pending);
  }
}

TEST_F(AsyncSegmenterTest, AScanWaitsNoLongerThanTheBudgetAndLateLabelsComeWithALaterScan) {
  source_.is_held = true;
  const auto labels = make_segmenter(20ms);
  const auto first = labels->submit(scan_at(1));
  EXPECT_TRUE(first.pending);
  EXPECT_TRUE(first.finished.empty());
  const auto second = labels->submit(scan_at(2));
  EXPECT_FALSE(second.pending);
  EXPECT_TRUE(second.finished.empty());
  source_.is_held = false;
  source_.is_held.notify_all();
  auto late = labels->submit(scan_at(3));
  const auto deadline = Clock::now() + 60s;
  for (int k = 4; late.finished.empty() && Clock::now() < deadline; ++k) {
    late = labels->submit(scan_at(k));
  }
  ASSERT_GE(late.finished.size(), 1U);
  EXPECT_EQ(late.finished[0].stamp_ns, 1);
}

TEST_F(AsyncSegmenterTest, CatchingUpComesFirstButNotForEver) {
  const auto labels = make_segmenter(5s);
  EXPECT_EQ(queue_.push_dropping_oldest({scan_at(100), "lidar", Clock::now()}), 0U);
  int segmented = 0;
  for (int k = 0; k < 33; ++k) segmented += labels->submit(scan_at(k)).finished.empty() ? 0 : 1;
  EXPECT_EQ(segmented, 3);
  ASSERT_TRUE(queue_.try_pop().has_value());
  EXPECT_FALSE(labels->submit(scan_at(33)).finished.empty());
}

TEST_F(AsyncSegmenterTest, LabelsThatCameWithAScanAreKeptWhateverWaits) {
  source_.is_held = true;
  AsyncSegmenter labels(
      std::make_unique<FallbackSegmenter>(std::make_unique<test::SlowSegmenter>(source_)), 20ms,
      queue_, statistics_);
  Scan unlabelled = scan_at(1);
  unlabelled.labels.clear();
  EXPECT_TRUE(labels.submit(unlabelled).pending);
  EXPECT_EQ(queue_.push_dropping_oldest({scan_at(100), "lidar", Clock::now()}), 0U);
  for (int k = 2; k < 12; ++k) {
    const auto output = labels.submit(scan_at(k));
    ASSERT_EQ(output.finished.size(), 1U) << k;
    EXPECT_EQ(output.finished[0].stamp_ns, k);
    EXPECT_EQ(output.finished[0].labels.classes[0], SemanticClass::road);
    EXPECT_FALSE(output.pending);
  }
  source_.is_held = false;
  source_.is_held.notify_all();
}

TEST_F(AsyncSegmenterTest, CoresTakeAScanEachWhereTheyAreTooSlowTogether) {
  source_.concurrent_scans = 3;
  source_.delay_ms = 60;
  const auto labels = make_segmenter(1ms);
  std::set<std::int64_t> pending;
  const auto deadline = Clock::now() + 60s;
  for (int k = 0; source_.max_in_work < 3 && Clock::now() < deadline; ++k) {
    statistics_.scan_received();
    const auto output = labels->submit(scan_at(k));
    for (const ScanLabels& finished : output.finished) {
      EXPECT_FALSE(finished.labels.empty());
      EXPECT_EQ(finished.stamp_ns == k ? 1U : pending.erase(finished.stamp_ns), 1U);
    }
    if (output.pending) pending.insert(k);
    std::this_thread::sleep_for(10ms);
  }
  EXPECT_EQ(source_.max_in_work, 3);
}

TEST_F(AsyncSegmenterTest, CoresStayTogetherWhereTheyKeepTheRate) {
  source_.concurrent_scans = 3;
  source_.delay_ms = 1;
  const auto labels = make_segmenter(5s);
  for (int k = 0; k < 20; ++k) {
    statistics_.scan_received();
    static_cast<void>(labels->submit(scan_at(k)));
    std::this_thread::sleep_for(10ms);
  }
  EXPECT_EQ(source_.max_in_work, 1);
}

TEST_F(AsyncSegmenterTest, WithoutABudgetEveryScanGetsItsLabels) {
  source_.delay_ms = 30;
  const auto labels = make_segmenter(0ms);
  EXPECT_FALSE(labels->may_skip_scans());
  for (int k = 0; k < 4; ++k) {
    const auto output = labels->submit(scan_at(k));
    ASSERT_EQ(output.finished.size(), 1U);
    EXPECT_EQ(output.finished[0].stamp_ns, k);
    EXPECT_FALSE(output.finished[0].labels.empty());
  }
}

TEST_F(AsyncSegmenterTest, WithoutABudgetEveryScanIsLookedAtClosely) {
  source_.delay_ms = 20;
  source_.costs = {1.0, 0.5};
  const auto labels = make_segmenter(0ms);
  for (int k = 0; k < 12; ++k) {
    // The sensor is four times as fast as the source.
    for (int i = 0; i < 4; ++i) statistics_.scan_received();
    (void)labels->submit(scan_at(k));
  }
  const dds::SegmentationStatus pace = status().segmentation;
  EXPECT_EQ(pace.interval, 1U);
  EXPECT_EQ(pace.image_columns, 2000U);
  EXPECT_GE(pace.inference_ms, 20.0);
}

TEST_F(AsyncSegmenterTest, FailuresAreCountedAndGiveNoLabels) {
  for (const auto budget : {0ms, 5000ms}) {
    const auto labels = make_segmenter(budget);
    source_.fails = true;
    const auto output = labels->submit(scan_at(1));
    ASSERT_EQ(output.finished.size(), 1U);
    EXPECT_TRUE(output.finished[0].labels.empty());
    EXPECT_EQ(statistics_.last_segmentation_failure(), "the network is broken");
    source_.fails = false;
    EXPECT_FALSE(labels->submit(scan_at(2)).finished[0].labels.empty());
    EXPECT_EQ(statistics_.last_segmentation_failure(), "");
  }
  EXPECT_EQ(status().counter("label_failures"), 2U);
}

TEST_F(AsyncSegmenterTest, EndsWhileTheSourceWorks) {
  source_.delay_ms = 200;
  {
    const auto labels = make_segmenter(1ms);
    EXPECT_TRUE(labels->submit(scan_at(1)).pending);
  }
  EXPECT_EQ(source_.labelled, 1);
}

TEST(SegmentationBudget, CountsForALiveNetworkOnly) {
  ServerConfig config;
  config.labels.budget_ms = 70;
  for (const auto source : {LabelProvider::stream, LabelProvider::none}) {
    config.labels.source = source;
    EXPECT_EQ(segmentation_budget(config), 0ms);
  }
  config.labels.source = LabelProvider::model;
  EXPECT_EQ(segmentation_budget(config), 70ms);
  config.input.delivery = DeliveryMode::every;
  EXPECT_EQ(segmentation_budget(config), 0ms);
}

}  // namespace
}  // namespace stillmap::server
