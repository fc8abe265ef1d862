#include "server/threads/prompt_turns.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <stdexcept>
#include <thread>

#include "server/threads/background_throttle.hpp"
#include "tests/server/manual_clock.hpp"

namespace stillmap::server {
namespace {

using namespace std::chrono_literals;

int nice_of_this_thread() { return ::getpriority(PRIO_PROCESS, static_cast<id_t>(::gettid())); }

void use_processor(std::chrono::nanoseconds time) {
  const auto begin = thread_cpu_time();
  while (thread_cpu_time() - begin < time) {
  }
}

class PromptTurnsTest : public ::testing::Test {
 protected:
  /// Whether a turn that takes so long runs here, at this thread's own priority.
  [[nodiscard]] bool runs_here(std::chrono::nanoseconds time = 0ns) {
    const auto caller = std::this_thread::get_id();
    const int nice = nice_of_this_thread();
    bool here = false;
    turns_.run([&] {
      use_processor(time);
      here = std::this_thread::get_id() == caller;
      EXPECT_EQ(nice_of_this_thread() > nice, !here);
    });
    return here;
  }

  test::ManualClock clock_;
  PromptBudget budget_{{.burst = 20ms, .debt = 200ms, .cores = 0.25}, clock_};
  PromptTurns turns_{budget_, "turns"};
};

TEST_F(PromptTurnsTest, ShortOnesRunAtOnceAndOthersBehindTheMapper) {
  EXPECT_TRUE(runs_here(1ms));
  EXPECT_TRUE(runs_here(30ms));
  EXPECT_FALSE(runs_here());
  EXPECT_FALSE(runs_here(30ms)) << "what runs behind the mapper costs nothing";
  clock_.advance(1s);
  EXPECT_TRUE(runs_here());
}

TEST_F(PromptTurnsTest, TimeComesBackBySharesOfACore) {
  budget_.spend(30ms);
  clock_.advance(36ms);
  EXPECT_FALSE(budget_.has_time());
  clock_.advance(8ms);
  EXPECT_TRUE(budget_.has_time());
}

TEST_F(PromptTurnsTest, ALongAnswerIsPaidForDownToABound) {
  budget_.spend(120ms);
  clock_.advance(390ms);
  EXPECT_FALSE(budget_.has_time());
  clock_.advance(20ms);
  EXPECT_TRUE(budget_.has_time());
  budget_.spend(1h);
  clock_.advance(810ms);
  EXPECT_TRUE(budget_.has_time());
}

TEST_F(PromptTurnsTest, IdleTimeIsNotSaved) {
  clock_.advance(1h);
  budget_.spend(21ms);
  EXPECT_FALSE(budget_.has_time());
}

TEST_F(PromptTurnsTest, WhatTheWorkThrowsReachesTheCaller) {
  const auto fail = [] { throw std::runtime_error("no answer"); };
  EXPECT_THROW(turns_.run(fail), std::runtime_error);
  budget_.spend(1h);
  EXPECT_THROW(turns_.run(fail), std::runtime_error);
  EXPECT_FALSE(runs_here());
}

}  // namespace
}  // namespace stillmap::server
