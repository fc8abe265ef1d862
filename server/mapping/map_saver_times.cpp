#include <algorithm>
#include <stdexcept>
#include <string>

#include "server/mapping/map_saver.hpp"

// When a saver may write, and when it is to.

namespace stillmap::server {
namespace {

/// Saves whose durations decide when the next one is due.
constexpr std::size_t recent_saves = 10;
/// The next save may take so many times the longest of them.
constexpr double duration_margin = 1.5;

/// Between saves is at least this part of the last one's duration.
constexpr int pause_divisor = 10;

}  // namespace

bool WriteAllowance::is_open(MonotonicClock::TimePoint now) {
  if (bytes_per_hour_ == 0.0) return true;
  if (refilled_) {
    const std::chrono::duration<double, std::ratio<3600>> hours = now - *refilled_;
    left_ = std::min(bytes_per_hour_, left_ + hours.count() * bytes_per_hour_);
  }
  refilled_ = now;
  return left_ > 0.0;
}

std::chrono::duration<double> due_after_begin(std::chrono::duration<double> period,
                                              std::chrono::duration<double> longest) {
  return std::max(period - duration_margin * longest, 0.5 * period);
}

CheckpointWorker::CheckpointWorker(std::chrono::duration<double> period, std::function<void()> save,
                                   MonotonicClock& clock)
    : period_(period),
      save_(std::move(save)),
      clock_(clock),
      worker_(
          "saver", [this](const std::stop_token&) { return save_and_schedule(); }, clock) {}

MonotonicClock::TimePoint CheckpointWorker::save_and_schedule() {
  const auto began = clock_.now();
  try {
    save_();
  } catch (const std::exception& error) {
    throttled_log_.error("save", std::string("the map was not saved: ") + error.what());
  }
  const auto ended = clock_.now();
  durations_.emplace_back(ended - began);
  if (durations_.size() > recent_saves) durations_.pop_front();
  const auto due = due_after_begin(period_, *std::ranges::max_element(durations_));
  // A mutex is not fair: without a pause, what clients ask of the saver would wait as long as saves
  // take longer than the period.
  return std::max(began + std::chrono::duration_cast<MonotonicClock::TimePoint::duration>(due),
                  ended + (ended - began) / pause_divisor);
}

}  // namespace stillmap::server
