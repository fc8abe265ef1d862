#include "core/process/stop_signals.hpp"

#include <gtest/gtest.h>
#include <pthread.h>
#include <unistd.h>

#include <ctime>
#include <thread>

namespace stillmap {
namespace {

/// Puts the mask and the handlers of the test program back.
class StopSignals : public testing::Test {
 protected:
  StopSignals() {
    pthread_sigmask(SIG_SETMASK, nullptr, &mask_);
    sigaction(SIGINT, nullptr, &interrupt_);
    sigaction(SIGTERM, nullptr, &terminate_);
  }
  ~StopSignals() override {
    sigaction(SIGINT, &interrupt_, nullptr);
    sigaction(SIGTERM, &terminate_, nullptr);
    pthread_sigmask(SIG_SETMASK, &mask_, nullptr);
  }

  /// The signal that is pending within 10 s; -1: none.
  static int next_signal(const sigset_t& signals) {
    const timespec timeout{.tv_sec = 10, .tv_nsec = 0};
    return sigtimedwait(&signals, nullptr, &timeout);
  }

 private:
  sigset_t mask_{};
  struct sigaction interrupt_ {};
  struct sigaction terminate_ {};
};

TEST_F(StopSignals, StayPendingForWhoWaits) {
  const sigset_t signals = block_stop_signals();
  kill(getpid(), SIGINT);
  EXPECT_EQ(next_signal(signals), SIGINT);
}

TEST_F(StopSignals, ReachWhoWaitsThroughThreadsThatWereThereBefore) {
  std::jthread of_a_library([](const std::stop_token& stop) {
    while (!stop.stop_requested()) std::this_thread::yield();
  });
  const sigset_t signals = block_stop_signals();
  // Twice: the thread blocks the signal from the first on.
  for (int i = 0; i < 2; ++i) {
    kill(getpid(), SIGTERM);
    EXPECT_EQ(next_signal(signals), SIGTERM);
  }
}

}  // namespace
}  // namespace stillmap
