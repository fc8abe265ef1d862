#include "core/odometry/scan_intervals.hpp"

#include <gtest/gtest.h>

namespace stillmap {
namespace {

constexpr std::int64_t ms_ns = 1'000'000;

ScanIntervals even_scans() {
  ScanIntervals intervals(0.1);
  intervals.begin(0);
  for (int k = 1; k <= 20; ++k) intervals.add(100 * k * ms_ns);
  return intervals;
}

TEST(ScanIntervals, AreMultiplesOfThePeriodWhereStampsHaveComeEvenly) {
  const ScanIntervals intervals = even_scans();
  EXPECT_DOUBLE_EQ(intervals.since_last_s(2100 * ms_ns), 0.1);
  EXPECT_DOUBLE_EQ(intervals.since_last_s(2190 * ms_ns), 0.2);
  EXPECT_DOUBLE_EQ(intervals.since_last_s(2010 * ms_ns), 0.1);
  EXPECT_DOUBLE_EQ(intervals.stamped_since_last_s(2010 * ms_ns), 0.01);
}

TEST(ScanIntervals, AreTheStampsAcrossALongGap) {
  EXPECT_DOUBLE_EQ(even_scans().since_last_s(5430 * ms_ns), 3.43);
}

TEST(ScanIntervals, AreThePeriodWhereStampsScatterAboutIt) {
  ScanIntervals intervals(0.1);
  intervals.begin(0);
  for (int k = 1; k <= 40; ++k) intervals.add((100 * k + (k % 2 == 0 ? 40 : -40)) * ms_ns);
  EXPECT_DOUBLE_EQ(intervals.since_last_s(4060 * ms_ns), 0.1);
  // One scan is missing.
  EXPECT_DOUBLE_EQ(intervals.since_last_s(4240 * ms_ns), 0.2);
}

TEST(ScanIntervals, AreTheStampsOfASensorThatTurnsFaster) {
  for (const std::int64_t period_ms : {50, 80, 125, 200}) {
    ScanIntervals intervals(0.1);
    intervals.begin(0);
    for (int k = 1; k <= 40; ++k) intervals.add(period_ms * k * ms_ns);
    EXPECT_NEAR(intervals.since_last_s(41 * period_ms * ms_ns),
                0.001 * static_cast<double>(period_ms), 1e-9);
  }
}

TEST(ScanIntervals, GoOnWhenALidarOfAnotherPeriodIsTold) {
  ScanIntervals intervals(0.1);
  intervals.begin(0);
  for (int k = 1; k <= 20; ++k) intervals.add(50 * k * ms_ns);
  intervals.set_period(0.1);
  EXPECT_DOUBLE_EQ(intervals.since_last_s(1050 * ms_ns), 0.05);
  EXPECT_DOUBLE_EQ(intervals.since_last_s(1550 * ms_ns), 0.55);
}

TEST(ScanIntervals, AreTheStampsOfASensorThatKeepsNoPeriod) {
  ScanIntervals intervals(0.1);
  intervals.begin(0);
  std::int64_t stamp_ns = 0;
  for (int k = 1; k <= 40; ++k) intervals.add(stamp_ns += (k % 2 == 0 ? 340 : 250) * ms_ns);
  EXPECT_DOUBLE_EQ(intervals.since_last_s(stamp_ns + 340 * ms_ns), 0.34);
}

TEST(ScanIntervals, GoOnByAClockThatWasSet) {
  ScanIntervals intervals = even_scans();
  const std::int64_t hour_back_ns = -3'600'000 * ms_ns;
  intervals.set_clock(hour_back_ns);
  EXPECT_DOUBLE_EQ(intervals.since_last_s(hour_back_ns + 3000 * ms_ns), 1.0);
  EXPECT_DOUBLE_EQ(intervals.last_interval_s(), 0.1);
}

TEST(ScanIntervals, AreAboveZeroWhateverTheStamp) {
  ScanIntervals fast(0.1);
  fast.begin(0);
  for (int k = 1; k <= 40; ++k) fast.add(50 * k * ms_ns);
  for (const ScanIntervals& intervals : {even_scans(), fast}) {
    EXPECT_GT(intervals.since_last_s(2000 * ms_ns), 0.0);
    EXPECT_GT(intervals.since_last_s(-3'600'000 * ms_ns), 0.0);
  }
}

TEST(ScanIntervals, AGapSaysNothingOfStampsThatScatter) {
  ScanIntervals intervals(0.1);
  intervals.begin(0);
  const auto add_from = [&](std::int64_t begin_ms) {
    for (int k = 1; k <= 40; ++k)
      intervals.add((begin_ms + 100 * k + (k % 2 == 0 ? 40 : -40)) * ms_ns);
  };
  add_from(0);
  add_from(64'000);
  EXPECT_DOUBLE_EQ(intervals.since_last_s((64'000 + 4060) * ms_ns), 0.1);
}

// Else the motion that is expected halves in the scan from which on the stamps are believed.
TEST(ScanIntervals, OfTheLastScansAreByTheSameRuleAsTheNext) {
  ScanIntervals intervals(0.1);
  intervals.begin(0);
  EXPECT_EQ(intervals.last_interval_s(), 0.0);
  for (int k = 1; k <= 40; ++k) {
    intervals.add(50 * k * ms_ns);
    EXPECT_NEAR(intervals.last_interval_s(), intervals.since_last_s(50 * (k + 1) * ms_ns), 1e-9)
        << "scan " << k;
  }
}

}  // namespace
}  // namespace stillmap
