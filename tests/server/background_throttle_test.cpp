#include "server/threads/background_throttle.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <memory>
#include <optional>
#include <thread>

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

/// Works and pauses for so long; returns the longest pause.
Clock::duration max_delay(const ThrottleCallback& callback, Clock::duration duration) {
  Clock::duration longest{};
  const auto end = Clock::now() + duration;
  while (Clock::now() < end) {
    const auto began = Clock::now();
    callback();
    longest = std::max(longest, Clock::now() - began);
  }
  return longest;
}

TEST(BackgroundThrottle, HoldsUpBackgroundWorkWhileAScanIsInWork) {
  BackgroundThrottle throttle;
  const ThrottleCallback callback =
      make_throttle_callback(throttle, SaturationPolicy::run_at_ten_percent);
  const BackgroundThrottle::ScanInProgress scan(throttle);
  EXPECT_FALSE(throttle.is_idle());
  EXPECT_GE(max_delay(callback, 200ms), 15ms);
}

TEST(BackgroundThrottle, LeavesNoTimeWhereScansNeverEndToWhoWaits) {
  BackgroundThrottle throttle;
  auto scan = std::make_unique<BackgroundThrottle::ScanInProgress>(throttle);
  std::atomic<std::uint64_t> rounds = 0;
  std::jthread background([&, callback = make_throttle_callback(throttle, SaturationPolicy::wait)](
                              const std::stop_token& stop) {
    for (; !stop.stop_requested(); ++rounds) callback();
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

TEST(BackgroundThrottle, LeavesSomeTimeWhereScansNeverEnd) {
  BackgroundThrottle throttle;
  const ThrottleCallback callback =
      make_throttle_callback(throttle, SaturationPolicy::run_at_ten_percent);
  const BackgroundThrottle::ScanInProgress scan(throttle);
  // Else it would not return at all.
  EXPECT_LT(max_delay(callback, 200ms), 10s);
}

TEST(BackgroundThrottle, LetsBackgroundWorkGoOnWhenTheScanIsDone) {
  BackgroundThrottle throttle;
  const ThrottleCallback callback =
      make_throttle_callback(throttle, SaturationPolicy::run_at_ten_percent);
  std::optional<BackgroundThrottle::ScanInProgress> scan(throttle);
  static_cast<void>(max_delay(callback, 50ms));
  scan.reset();
  EXPECT_TRUE(throttle.is_idle());
  int calls = 0;
  const auto end = Clock::now() + 100ms;
  for (; Clock::now() < end; ++calls) callback();
  EXPECT_GT(calls, 100) << "each call is only a look at the clock";
}

TEST(BackgroundThrottle, HoldsUpNobodyAtTheEnd) {
  BackgroundThrottle throttle;
  const BackgroundThrottle::ScanInProgress scan(throttle);
  throttle.release();
  EXPECT_TRUE(throttle.is_idle());
}

}  // namespace
}  // namespace stillmap::server
