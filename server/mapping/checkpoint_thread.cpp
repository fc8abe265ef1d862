#include "server/mapping/checkpoint_thread.hpp"

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <mutex>
#include <utility>

namespace stillmap::server {
namespace {

using Clock = std::chrono::steady_clock;
using Seconds = std::chrono::duration<double>;

/// Saves that tell how long one takes.
constexpr std::size_t recent_saves = 10;
/// The next save may take so much longer than the longest of them.
constexpr double margin = 1.5;

}  // namespace

Seconds due_after_begin(Seconds period, Seconds longest) {
  return std::max(period - margin * longest, 0.5 * period);
}

CheckpointThread::CheckpointThread(Seconds period, std::function<void()> save)
    : save_(std::move(save)),
      thread_([this, period](const std::stop_token& stop) { work(stop, period); }) {}

void CheckpointThread::work(const std::stop_token& stop, Seconds period) const {
  std::deque<Seconds> took;
  std::mutex mutex;
  std::condition_variable_any never_notified;
  std::unique_lock lock(mutex);
  while (!stop.stop_requested()) {
    const auto began = Clock::now();
    save_();
    took.emplace_back(Clock::now() - began);
    if (took.size() > recent_saves) took.pop_front();
    const Seconds due = due_after_begin(period, *std::ranges::max_element(took));
    never_notified.wait_until(lock, stop, began + std::chrono::duration_cast<Clock::duration>(due),
                              [] { return false; });
  }
}

}  // namespace stillmap::server
