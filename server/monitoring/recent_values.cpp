#include "server/monitoring/recent_values.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap::server {

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

}  // namespace stillmap::server
