#include "server/statistics.hpp"

#include <algorithm>

namespace stillmap {
namespace {

constexpr std::chrono::seconds rate_window{5};

}  // namespace

void RateWindow::add(Clock::time_point event) {
  events_.push_back(event);
  while (event - events_.front() > rate_window) events_.pop_front();
}

double RateWindow::rate_hz(Clock::time_point now) const {
  const auto is_recent = [&](Clock::time_point event) { return now - event <= rate_window; };
  const auto first = std::ranges::find_if(events_, is_recent);
  const auto count = static_cast<double>(events_.end() - first);
  if (count < 2) return count / std::chrono::duration<double>(rate_window).count();
  // Between the events, so that the rate is right from the second scan on.
  const double span_s = std::chrono::duration<double>(now - *first).count();
  return count / std::max(span_s, 1e-3);
}

void Statistics::scan_received() {
  const std::scoped_lock lock(mutex_);
  ++received_;
  received_rate_.add(RateWindow::Clock::now());
}

void Statistics::scan_mapped() {
  const std::scoped_lock lock(mutex_);
  ++mapped_;
  mapped_rate_.add(RateWindow::Clock::now());
  last_drop_.clear();
}

void Statistics::scans_dropped(const std::string& reason, std::size_t count,
                               const std::string& detail) {
  const std::scoped_lock lock(mutex_);
  const std::string name = "dropped_" + reason;
  const auto known = std::ranges::find(dropped_, name, &NamedCounter::name);
  NamedCounter& counter =
      known == dropped_.end() ? dropped_.emplace_back(NamedCounter{.name = name}) : *known;
  counter.value += count;
  last_drop_ = detail;
}

void Statistics::add_latency(const std::string& stage, double milliseconds) {
  const std::scoped_lock lock(mutex_);
  auto known = std::ranges::find(latencies_, stage, &std::pair<std::string, LatencyWindow>::first);
  if (known == latencies_.end()) {
    latencies_.emplace_back(stage, LatencyWindow());
    known = std::prev(latencies_.end());
  }
  known->second.add(milliseconds);
}

void Statistics::report_to(ServerStatus& status) const {
  const std::scoped_lock lock(mutex_);
  const auto now = RateWindow::Clock::now();
  status.received_hz = received_rate_.rate_hz(now);
  status.mapped_hz = mapped_rate_.rate_hz(now);
  status.counters = {{.name = "scans_received", .value = received_},
                     {.name = "scans_mapped", .value = mapped_}};
  status.counters.insert(status.counters.end(), dropped_.begin(), dropped_.end());
  status.latencies.clear();
  for (const auto& [stage, window] : latencies_) status.latencies.push_back(window.summary(stage));
}

std::uint64_t Statistics::received() const {
  const std::scoped_lock lock(mutex_);
  return received_;
}

std::string Statistics::last_drop() const {
  const std::scoped_lock lock(mutex_);
  return last_drop_;
}

}  // namespace stillmap
