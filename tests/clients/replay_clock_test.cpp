#include "clients/commands/live/replay_clock.hpp"

#include <gtest/gtest.h>

#include <limits>
#include <vector>

namespace stillmap::cli {
namespace {

using namespace std::chrono_literals;
using Milliseconds = std::chrono::milliseconds;

constexpr std::int64_t second_ns = 1'000'000'000;

/// After the beginning, of scans with these stamps.
std::vector<Milliseconds> due_times(const std::vector<std::int64_t>& stamps_ns, double rate) {
  const ReplayClock::Clock::time_point began;
  ReplayClock clock(began, stamps_ns.front(), rate);
  std::vector<Milliseconds> times;
  for (const std::int64_t stamp_ns : stamps_ns) {
    times.push_back(std::chrono::round<Milliseconds>(clock.due(stamp_ns) - began));
  }
  return times;
}

TEST(ReplayClock, ScansAreDueAtTheStepsOfTheirStamps) {
  const std::vector<std::int64_t> stamps_ns = {5 * second_ns, 5 * second_ns + 100'000'000,
                                               7 * second_ns};
  EXPECT_EQ(due_times(stamps_ns, 1.0), (std::vector<Milliseconds>{0ms, 100ms, 2000ms}));
  EXPECT_EQ(due_times(stamps_ns, 2.0), (std::vector<Milliseconds>{0ms, 50ms, 1000ms}));
  EXPECT_EQ(due_times(stamps_ns, 0.01), (std::vector<Milliseconds>{0ms, 10000ms, 200000ms}));
  EXPECT_EQ(due_times(stamps_ns, 0.0), (std::vector<Milliseconds>{0ms, 0ms, 0ms}));
}

TEST(ReplayClock, NobodyWaitsForTheDaysBetweenTwoRecordingsOfOneBag) {
  EXPECT_EQ(due_times({0, 86400 * second_ns, 86401 * second_ns}, 1.0),
            (std::vector<Milliseconds>{0ms, 10000ms, 11000ms}));
}

TEST(ReplayClock, AClockThatIsSetBackDelaysNothingAndHurriesNothing) {
  EXPECT_EQ(due_times({100 * second_ns, 2 * second_ns, 3 * second_ns, 4 * second_ns}, 1.0),
            (std::vector<Milliseconds>{0ms, 0ms, 1000ms, 2000ms}));
}

TEST(ReplayClock, StampsOutOfOrderTakeNoLonger) {
  constexpr std::int64_t ms_ns = 1'000'000;
  EXPECT_EQ(due_times({0, -50 * ms_ns, 100 * ms_ns, 50 * ms_ns, 200 * ms_ns}, 1.0),
            (std::vector<Milliseconds>{0ms, -50ms, 100ms, 50ms, 200ms}));
}

TEST(ReplayClock, TakesRatesThatMakeNoSense) {
  const std::vector<Milliseconds> times = due_times({0, second_ns}, 1e-30);
  EXPECT_EQ(times.back(), Milliseconds(ReplayClock::max_wait));
}

TEST(ReplayClock, TakesStampsThatMakeNoSense) {
  constexpr std::int64_t first_ns = std::numeric_limits<std::int64_t>::min();
  constexpr std::int64_t last_ns = std::numeric_limits<std::int64_t>::max();
  EXPECT_EQ(due_times({first_ns, last_ns, first_ns, 0}, 1.0),
            (std::vector<Milliseconds>{0ms, 10000ms, 10000ms, 20000ms}));
}

}  // namespace
}  // namespace stillmap::cli
