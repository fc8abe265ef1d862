#include "server/mapping/checkpoint_thread.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <mutex>
#include <vector>

namespace stillmap::server {
namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

TEST(DueAfterBegin, LeavesTimeForTheSaveItself) {
  EXPECT_EQ(due_after_begin(Seconds(5.0), Seconds(0.0)), Seconds(5.0));
  EXPECT_EQ(due_after_begin(Seconds(5.0), Seconds(1.0)), Seconds(3.5));
}

TEST(DueAfterBegin, LeavesTimeBetweenSavesThatTakeTooLong) {
  EXPECT_EQ(due_after_begin(Seconds(5.0), Seconds(4.0)), Seconds(2.5));
  EXPECT_EQ(due_after_begin(Seconds(5.0), Seconds(60.0)), Seconds(2.5));
}

TEST(CheckpointThread, BeginsTheNextSaveBeforeThePeriodIsOver) {
  constexpr Seconds period(0.4);
  constexpr Seconds save_takes(0.1);
  std::mutex mutex;
  std::vector<Clock::time_point> begins;
  {
    const CheckpointThread thread(period, [&] {
      {
        const std::scoped_lock lock(mutex);
        begins.push_back(Clock::now());
      }
      std::this_thread::sleep_for(save_takes);
    });
    std::this_thread::sleep_for(std::chrono::milliseconds(1100));
  }
  // After the period and the save, three of them began; the schedule fits in four.
  ASSERT_GE(begins.size(), 4U);
  EXPECT_GE(begins[2] - begins[1], save_takes) << "a save waits for the one before";
}

TEST(CheckpointThread, StopsAtOnceWhileItWaits) {
  const auto began = Clock::now();
  std::atomic<int> saves{0};
  {
    const CheckpointThread thread(Seconds(3600.0), [&] { ++saves; });
    while (saves == 0) std::this_thread::yield();
  }
  EXPECT_LT(Clock::now() - began, std::chrono::seconds(60));
  EXPECT_EQ(saves, 1);
}

}  // namespace
}  // namespace stillmap::server
