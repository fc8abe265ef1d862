#include "server/scan_traffic.hpp"

#include <chrono>
#include <thread>

namespace stillmap {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto work_between_pauses = 2ms;
constexpr auto longest_pause = 9 * work_between_pauses;
constexpr auto look_period = 1ms;

}  // namespace

Pause give_way_to(const ScanTraffic& traffic) {
  return [&traffic, worked_since = Clock::now()]() mutable {
    const auto began = Clock::now();
    if (began - worked_since < work_between_pauses) return;
    while (!traffic.is_quiet() && Clock::now() - began < longest_pause) {
      std::this_thread::sleep_for(look_period);
    }
    worked_since = Clock::now();
  };
}

}  // namespace stillmap
