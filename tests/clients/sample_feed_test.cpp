#include "clients/commands/mapping/sample_feed.hpp"

#include <gtest/gtest.h>

namespace stillmap::cli {
namespace {

constexpr std::int64_t second_ns = 1'000'000'000;

struct Sample {
  std::int64_t stamp_ns = 0;
};

Scan scan_of(std::int64_t stamp_ns) {
  Scan scan;
  scan.stamp_ns = stamp_ns;
  return scan;
}

TEST(SampleFeed, HandsOutEachOnceWithTheScanItBelongsTo) {
  SampleFeed<Sample> feed({{0}, {second_ns}, {2 * second_ns}, {3 * second_ns}});
  EXPECT_EQ(feed.take_up_to_end_of(scan_of(second_ns), 0.1).size(), 2U);
  EXPECT_EQ(feed.take_up_to_end_of(scan_of(second_ns), 0.1).size(), 0U);
  EXPECT_EQ(feed.take_up_to_end_of(scan_of(3 * second_ns), 0.1).size(), 2U);
}

TEST(SampleFeed, ASampleOfTheFutureHoldsUpNoOther) {
  SampleFeed<Sample> feed({{0}, {900 * second_ns}, {second_ns}, {2 * second_ns}});
  EXPECT_EQ(feed.take_up_to_end_of(scan_of(0), 0.1).size(), 1U);
  EXPECT_EQ(feed.take_up_to_end_of(scan_of(2 * second_ns), 0.1).size(), 2U);
}

TEST(SampleFeed, AScanOfTheFutureTakesNotAll) {
  std::vector<Sample> samples;
  for (std::int64_t k = 0; k < 100; ++k) samples.push_back({k * second_ns});
  SampleFeed<Sample> feed(std::move(samples));
  EXPECT_EQ(feed.take_up_to_end_of(scan_of(0), 0.1).size(), 1U);
  EXPECT_LE(feed.take_up_to_end_of(scan_of(1000 * second_ns), 0.1).size(), 10U);
  std::size_t rest = 0;
  for (std::int64_t k = 11; k < 100; ++k)
    rest += feed.take_up_to_end_of(scan_of(k * second_ns), 0.1).size();
  EXPECT_EQ(rest, 89U);
}

TEST(SampleFeed, AGapIsCaughtUpWith) {
  SampleFeed<Sample> feed({{0}, {50 * second_ns}, {51 * second_ns}});
  static_cast<void>(feed.take_up_to_end_of(scan_of(0), 0.1));
  std::size_t taken = 0;
  for (int k = 0; k < 6; ++k)
    taken += feed.take_up_to_end_of(scan_of((50 + k) * second_ns), 0.1).size();
  EXPECT_EQ(taken, 2U);
}

TEST(SampleFeed, HandsOutSamplesThatAreLate) {
  constexpr std::int64_t max_late_ns = 150'000'000;
  SampleFeed<Sample> feed({{0}, {max_late_ns}, {second_ns}});
  EXPECT_EQ(feed.take_up_to_end_of(scan_of(0), 0.1).size(), 2U);
}

}  // namespace
}  // namespace stillmap::cli
