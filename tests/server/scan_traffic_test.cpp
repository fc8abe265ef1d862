#include "server/scan_traffic.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <thread>

namespace stillmap {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

/// Calls it for so long; returns the longest call.
Clock::duration longest_pause(const Pause& pause, Clock::duration duration) {
  Clock::duration longest{};
  const auto end = Clock::now() + duration;
  while (Clock::now() < end) {
    const auto began = Clock::now();
    pause();
    longest = std::max(longest, Clock::now() - began);
  }
  return longest;
}

TEST(ScanTraffic, HoldsUpBackgroundWorkWhileAScanIsInWork) {
  ScanTraffic traffic;
  const Pause pause = give_way_to(traffic);
  const ScanTraffic::InWork scan(traffic);
  EXPECT_FALSE(traffic.is_quiet());
  EXPECT_GE(longest_pause(pause, 100ms), 15ms);
}

TEST(ScanTraffic, LetsBackgroundWorkGoOnAsSoonAsTheScanIsDone) {
  ScanTraffic traffic;
  Pause pause = give_way_to(traffic);
  { const ScanTraffic::InWork scan(traffic); }
  EXPECT_TRUE(traffic.is_quiet());
  int calls = 0;
  const auto end = Clock::now() + 50ms;
  while (Clock::now() < end) {
    pause();
    ++calls;
  }
  EXPECT_GT(calls, 1000) << "each call is only a look at the clock";
}

TEST(ScanTraffic, LeavesSomeTimeWhereScansNeverEnd) {
  ScanTraffic traffic;
  const Pause pause = give_way_to(traffic);
  const ScanTraffic::InWork scan(traffic);
  int pauses = 0;
  for (int i = 0; i < 5; ++i) {
    const auto work_ends = Clock::now() + 3ms;
    while (Clock::now() < work_ends) {
    }
    pause();
    ++pauses;
  }
  EXPECT_EQ(pauses, 5) << "returned each time, though the scan is still in work";
}

}  // namespace
}  // namespace stillmap
