#include "server/mapping/background_throttle.hpp"

#include <time.h>

#include <algorithm>
#include <chrono>
#include <thread>

namespace stillmap {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto work_between_pauses = 2ms;
/// Longest pause, in times of the work before it.
constexpr int rest = 9;
constexpr std::chrono::nanoseconds longest_rest = 1s;
constexpr auto look_period = 1ms;

/// The time that the calling thread has worked; one that gives way to others may get none for long.
std::chrono::nanoseconds worked() {
  timespec used{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
  return std::chrono::seconds(used.tv_sec) + std::chrono::nanoseconds(used.tv_nsec);
}

}  // namespace

Pause give_way_to(const ScanTraffic& traffic, WithoutGaps without_gaps) {
  return [&traffic, without_gaps, last = std::chrono::nanoseconds(0)]() mutable {
    const auto work = worked() - last;
    if (work < work_between_pauses) return;
    const auto until = without_gaps == WithoutGaps::wait
                           ? Clock::time_point::max()
                           : Clock::now() + std::min(rest * work, longest_rest);
    while (!traffic.is_quiet() && Clock::now() < until) {
      std::this_thread::sleep_for(look_period);
    }
    last = worked();
  };
}

}  // namespace stillmap
