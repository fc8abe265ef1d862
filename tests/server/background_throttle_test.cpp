#include "server/mapping/background_throttle.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <thread>

namespace stillmap {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

/// Works and pauses for so long; returns the longest pause.
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
  const Pause pause = give_way_to(traffic, WithoutGaps::work_a_tenth);
  const ScanTraffic::InWork scan(traffic);
  EXPECT_FALSE(traffic.is_quiet());
  EXPECT_GE(longest_pause(pause, 200ms), 15ms);
}

TEST(ScanTraffic, LeavesNoTimeWhereScansNeverEndToWhoWaits) {
  ScanTraffic traffic;
  auto scan = std::make_unique<ScanTraffic::InWork>(traffic);
  std::atomic<std::uint64_t> rounds = 0;
  std::jthread background(
      [&, pause = give_way_to(traffic, WithoutGaps::wait)](const std::stop_token& stop) {
        for (; !stop.stop_requested(); ++rounds) pause();
      });
  // It may take a while to work at all; then it rests for longer than who works a tenth of the
  // time.
  const auto deadline = Clock::now() + 60s;
  std::uint64_t before = 0;
  do {
    before = rounds;
    std::this_thread::sleep_for(1200ms);
  } while ((rounds == 0 || rounds != before) && Clock::now() < deadline);
  EXPECT_EQ(rounds, before);
  scan.reset();
  while (rounds == before && Clock::now() < deadline) std::this_thread::sleep_for(1ms);
  EXPECT_GT(rounds, before);
}

TEST(ScanTraffic, LeavesSomeTimeWhereScansNeverEnd) {
  ScanTraffic traffic;
  const Pause pause = give_way_to(traffic, WithoutGaps::work_a_tenth);
  const ScanTraffic::InWork scan(traffic);
  // Else it would not return at all.
  EXPECT_LT(longest_pause(pause, 200ms), 10s);
}

TEST(ScanTraffic, LetsBackgroundWorkGoOnWhenTheScanIsDone) {
  ScanTraffic traffic;
  const Pause pause = give_way_to(traffic, WithoutGaps::work_a_tenth);
  std::optional<ScanTraffic::InWork> scan(traffic);
  static_cast<void>(longest_pause(pause, 50ms));
  scan.reset();
  EXPECT_TRUE(traffic.is_quiet());
  int calls = 0;
  const auto end = Clock::now() + 100ms;
  for (; Clock::now() < end; ++calls) pause();
  EXPECT_GT(calls, 100) << "each call is only a look at the clock";
}

TEST(ScanTraffic, HoldsUpNobodyAtTheEnd) {
  ScanTraffic traffic;
  const ScanTraffic::InWork scan(traffic);
  traffic.end();
  EXPECT_TRUE(traffic.is_quiet());
}

}  // namespace
}  // namespace stillmap
