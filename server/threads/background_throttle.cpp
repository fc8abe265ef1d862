#include "server/threads/background_throttle.hpp"

#include <sched.h>
#include <sys/resource.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_arena.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <system_error>
#include <thread>

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;

constexpr auto work_between_rests = 2ms;
/// Longest pause, in times of the work before it.
constexpr int rest_ratio = 9;
constexpr std::chrono::nanoseconds max_rest = 1s;
constexpr auto poll_period = 1ms;
/// Beyond the process's own nice value.
constexpr int low_nice = 10;

/// Nice values are a thread's own in Linux.
bool add_nice(int more) {
  const auto thread = static_cast<id_t>(::gettid());
  return ::setpriority(PRIO_PROCESS, thread, ::getpriority(PRIO_PROCESS, thread) + more) == 0;
}

}  // namespace

std::chrono::nanoseconds thread_cpu_time() {
  timespec used{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
  return std::chrono::seconds(used.tv_sec) + std::chrono::nanoseconds(used.tv_nsec);
}

bool use_scheduling(BackgroundScheduling scheduling) {
  if (scheduling == BackgroundScheduling::normal) return true;
  if (scheduling == BackgroundScheduling::low) return add_nice(low_nice);
  // A nice value is not enough: the network's threads wait for each other many times a scan, and a
  // thread that holds one of them up for a moment holds up both.
  const sched_param none{};
  return sched_setscheduler(0, SCHED_IDLE, &none) == 0;
}

void start_tbb_workers() {
  // Where the system grants fewer threads than that.
  constexpr auto max_wait = 1s;
  const int threads = tbb::this_task_arena::max_concurrency();
  const auto deadline = std::chrono::steady_clock::now() + max_wait;
  std::atomic<int> arrived = 0;
  // Each thread has one of the tasks, as none ends before all have begun.
  tbb::parallel_for(
      0, threads,
      [&](int) {
        ++arrived;
        while (arrived < threads && std::chrono::steady_clock::now() < deadline) {
          std::this_thread::yield();
        }
      },
      tbb::simple_partitioner());
}

void run_behind_the_mapper(const std::function<void()>& work) {
  tbb::task_arena arena(tbb::task_arena::automatic, 1, tbb::task_arena::priority::low);
  arena.execute(work);
}

void end_idle_scheduling() {
  std::error_code none;
  for (const auto& thread : std::filesystem::directory_iterator("/proc/self/task", none)) {
    const auto id = static_cast<pid_t>(std::strtol(thread.path().filename().c_str(), nullptr, 10));
    const sched_param normal{};
    if (sched_getscheduler(id) == SCHED_IDLE) sched_setscheduler(id, SCHED_OTHER, &normal);
  }
}

ThrottleCallback make_throttle_callback(const BackgroundThrottle& throttle,
                                        SaturationPolicy saturation_policy, MonotonicClock& clock) {
  return [&throttle, &clock, saturation_policy, last = std::chrono::nanoseconds(0)]() mutable {
    const auto work = thread_cpu_time() - last;
    if (work < work_between_rests) return;
    const auto until = saturation_policy == SaturationPolicy::wait
                           ? MonotonicClock::TimePoint::max()
                           : clock.now() + std::min(rest_ratio * work, max_rest);
    while (!throttle.is_idle() && clock.now() < until) {
      clock.sleep_until(clock.now() + poll_period, {});
    }
    last = thread_cpu_time();
  };
}

}  // namespace stillmap::server
