#include "server/threads/background_throttle.hpp"

#include <gtest/gtest.h>
#include <sched.h>
#include <sys/resource.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <optional>
#include <thread>

#include "tests/eventually.hpp"
#include "tests/server/manual_clock.hpp"

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;
using Duration = std::chrono::duration<double>;

/// A background thread that always has work, beside a scan that lasts until `end_scan`.
class ThrottledWork {
 public:
  explicit ThrottledWork(SaturationPolicy policy)
      : thread_([this, callback = make_throttle_callback(throttle_, policy, clock_)](
                    const std::stop_token& stop) {
          for (; !stop.stop_requested(); ++rounds_) callback();
        }) {}
  ~ThrottledWork() {
    if (scan_) end_scan();
  }
  ThrottledWork(const ThrottledWork&) = delete;
  ThrottledWork& operator=(const ThrottledWork&) = delete;

  /// Waits until the thread is held up; returns whether it is.
  [[nodiscard]] bool is_held_up() { return clock_.wait_for_sleeper().has_value(); }
  /// So much time passes while it is held up; returns whether it still is.
  [[nodiscard]] bool is_held_up_after(Duration time) {
    const std::uint64_t before = rounds_;
    clock_.advance(time);
    return is_held_up() && rounds_ == before;
  }
  /// How long it is held up, once it is; a minute for longer.
  [[nodiscard]] Duration pause() {
    Duration waited{0};
    const std::uint64_t before = is_held_up() ? rounds_.load() : 0;
    for (auto left = clock_.wait_for_sleeper(); left && waited < 60s;
         left = clock_.wait_for_sleeper()) {
      if (rounds_ != before) return waited;
      clock_.advance(*left);
      waited += *left;
    }
    return waited;
  }
  void end_scan() {
    // It must sleep before the clock's last step: nobody would wake it after that.
    EXPECT_TRUE(is_held_up());
    scan_.reset();
    clock_.advance(1h);
  }
  [[nodiscard]] std::uint64_t rounds() const { return rounds_; }

 private:
  BackgroundThrottle throttle_;
  std::optional<BackgroundThrottle::ScanInProgress> scan_{throttle_};
  test::ManualClock clock_;
  std::atomic<std::uint64_t> rounds_ = 0;
  // Last: ends before what it uses is gone.
  std::jthread thread_;
};

TEST(BackgroundThrottle, LeavesATenthOfTheTimeWhereScansNeverEnd) {
  ThrottledWork work(SaturationPolicy::run_at_ten_percent);
  for (int i = 0; i < 3; ++i) {
    const Duration pause = work.pause();
    // Nine times the 2 ms of work that it is allowed at least.
    EXPECT_GE(pause, 17.9ms);
    EXPECT_LE(pause, 1001ms);
  }
}

TEST(BackgroundThrottle, LeavesNoTimeWhereScansNeverEndToWhoWaits) {
  ThrottledWork work(SaturationPolicy::wait);
  ASSERT_TRUE(work.is_held_up());
  for (const Duration time : {Duration(0.1s), Duration(2s), Duration(24h)}) {
    EXPECT_TRUE(work.is_held_up_after(time)) << time.count() << " s";
  }
}

TEST(BackgroundThrottle, LetsBackgroundWorkGoOnWhenTheScanIsDone) {
  for (const auto policy : {SaturationPolicy::wait, SaturationPolicy::run_at_ten_percent}) {
    ThrottledWork work(policy);
    work.end_scan();
    const std::uint64_t before = work.rounds();
    EXPECT_TRUE(test::eventually([&] { return work.rounds() > before + 1000; }));
  }
}

TEST(BackgroundThrottle, HoldsUpNobodyAtTheEnd) {
  BackgroundThrottle throttle;
  const BackgroundThrottle::ScanInProgress scan(throttle);
  EXPECT_FALSE(throttle.is_idle());
  throttle.release();
  EXPECT_TRUE(throttle.is_idle());
}

TEST(BackgroundThrottle, ThreadsThatAreToEndRunBesideAllOthers) {
  BackgroundThrottle throttle;
  std::atomic<pid_t> thread_id = 0;
  const std::jthread background([&](const std::stop_token& stop) {
    ASSERT_TRUE(use_scheduling(BackgroundScheduling::idle));
    thread_id = gettid();
    while (!stop.stop_requested()) std::this_thread::sleep_for(1ms);
  });
  ASSERT_TRUE(test::eventually([&] { return thread_id != 0; }));
  EXPECT_EQ(sched_getscheduler(thread_id), SCHED_IDLE);
  throttle.release();
  EXPECT_EQ(sched_getscheduler(thread_id), SCHED_OTHER);
}

int nice_of_this_thread() { return ::getpriority(PRIO_PROCESS, static_cast<id_t>(::gettid())); }

TEST(BackgroundScheduling, LowIsANiceValueOfTheThreadAlone) {
  const int before = nice_of_this_thread();
  int within = before;
  std::jthread([&] {
    EXPECT_TRUE(use_scheduling(BackgroundScheduling::low));
    within = nice_of_this_thread();
  }).join();
  EXPECT_EQ(within, std::min(before + 10, 19));
  EXPECT_EQ(nice_of_this_thread(), before);
}

TEST(BackgroundScheduling, WorkersThatWereStartedBeforeKeepTheirPriority) {
  const int before = nice_of_this_thread();
  start_tbb_workers();
  std::atomic<int> by_others = 0;
  std::atomic<int> low = 0;
  const auto low_thread = [&] {
    static_cast<void>(use_scheduling(BackgroundScheduling::low));
    const auto own = std::this_thread::get_id();
    const auto deadline = std::chrono::steady_clock::now() + 10s;
    while (by_others == 0 && std::chrono::steady_clock::now() < deadline) {
      tbb::parallel_for(0, 100, [&](int) {
        std::this_thread::sleep_for(1ms);
        if (std::this_thread::get_id() == own) return;
        ++by_others;
        if (nice_of_this_thread() != before) ++low;
      });
    }
  };
  std::jthread(low_thread).join();
  if (tbb::this_task_arena::max_concurrency() > 1) {
    EXPECT_GT(by_others, 0);
  }
  EXPECT_EQ(low, 0);
}

}  // namespace
}  // namespace stillmap::server
