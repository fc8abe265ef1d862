#include "server/monitoring/recent_values.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap::server {
namespace {

constexpr std::chrono::seconds rate_window{5};
constexpr std::size_t label_provenance_window = 100;

}  // namespace

void LatencyWindow::add(double milliseconds) {
  if (values_ms_.size() < capacity_) {
    values_ms_.push_back(milliseconds);
  } else {
    values_ms_[next_] = milliseconds;
  }
  next_ = (next_ + 1) % capacity_;
}

dds::StageLatency LatencyWindow::summary(const std::string& stage) const {
  if (values_ms_.empty()) return {.stage = stage};
  std::vector<double> sorted = values_ms_;
  std::ranges::sort(sorted);
  // Nearest rank: the smallest value that this share of the values does not exceed.
  const auto percentile = [&](double share) {
    const double rank = std::ceil(share * static_cast<double>(sorted.size()));
    return sorted[static_cast<std::size_t>(std::max(rank, 1.0)) - 1];
  };
  return {.stage = stage,
          .p50_ms = percentile(0.50),
          .p99_ms = percentile(0.99),
          .max_ms = sorted.back(),
          .samples = static_cast<std::uint32_t>(sorted.size())};
}

void RecentMedian::add(double value) {
  last_.push_back(value);
  if (last_.size() > window_) last_.pop_front();
}

double RecentMedian::value() const {
  if (last_.empty()) return 0.0;
  std::vector<double> sorted(last_.begin(), last_.end());
  std::ranges::sort(sorted);
  return sorted[sorted.size() / 2];
}

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

void LabelProvenanceWindow::add(LabelProvenance label_provenance) {
  last_.push_back(label_provenance);
  if (last_.size() > label_provenance_window) last_.pop_front();
}

double LabelProvenanceWindow::share(LabelProvenance label_provenance) const {
  if (last_.empty()) return 0.0;
  return static_cast<double>(std::ranges::count(last_, label_provenance)) /
         static_cast<double>(last_.size());
}

}  // namespace stillmap::server
