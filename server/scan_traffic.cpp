#include "server/scan_traffic.hpp"

#include <time.h>

#include <chrono>
#include <thread>

namespace stillmap {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto work_between_pauses = 2ms;
constexpr auto longest_pause = 9 * work_between_pauses;
constexpr auto look_period = 1ms;

/// The time that the calling thread has worked; one that gives way to others may get none for long.
std::chrono::nanoseconds worked() {
  timespec used{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &used);
  return std::chrono::seconds(used.tv_sec) + std::chrono::nanoseconds(used.tv_nsec);
}

}  // namespace

Pause give_way_to(const ScanTraffic& traffic) {
  return [&traffic, last = std::chrono::nanoseconds(0)]() mutable {
    if (worked() - last < work_between_pauses) return;
    const auto began = Clock::now();
    while (!traffic.is_quiet() && Clock::now() - began < longest_pause) {
      std::this_thread::sleep_for(look_period);
    }
    last = worked();
  };
}

}  // namespace stillmap
