#include "server/threads/prompt_turns.hpp"

#include <algorithm>
#include <utility>

#include "server/threads/background_throttle.hpp"

namespace stillmap::server {

bool PromptBudget::has_time() {
  const std::scoped_lock lock(mutex_);
  fill();
  return left_ > std::chrono::nanoseconds(0);
}

void PromptBudget::spend(std::chrono::nanoseconds processor_time) {
  const std::scoped_lock lock(mutex_);
  fill();
  left_ = std::max(left_ - processor_time, -limits_.debt);
}

void PromptBudget::fill() {
  const auto now = clock_.now();
  const std::chrono::duration<double, std::nano> gained = limits_.cores * (now - filled_);
  left_ =
      std::min(left_ + std::chrono::duration_cast<std::chrono::nanoseconds>(gained), limits_.burst);
  filled_ = now;
}

PromptTurns::PromptTurns(PromptBudget& budget, const std::string& name)
    : budget_(budget),
      low_priority_(
          name, waiting_,
          [](std::packaged_task<void()> turn) { run_behind_the_mapper([&] { turn(); }); },
          {.on_start = [] { static_cast<void>(use_scheduling(BackgroundScheduling::low)); }}) {}

void PromptTurns::run(const std::function<void()>& work) {
  if (!budget_.has_time()) {
    std::packaged_task<void()> turn(work);
    std::future<void> done = turn.get_future();
    static_cast<void>(waiting_.push_blocking(std::move(turn), {}));
    return done.get();
  }
  const auto before = thread_cpu_time();
  std::packaged_task<void()> turn(work);
  run_behind_the_mapper([&] { turn(); });
  budget_.spend(thread_cpu_time() - before);
  turn.get_future().get();
}

}  // namespace stillmap::server
