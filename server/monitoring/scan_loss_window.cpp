#include "server/monitoring/scan_loss_window.hpp"

#include <utility>

namespace stillmap::server {
namespace {

constexpr std::chrono::seconds window_length{30};

}  // namespace

void ScanLossWindow::add(const std::string& writer_guid, std::uint64_t lost,
                         Clock::time_point now) {
  const std::scoped_lock lock(mutex_);
  advance(now);
  Counts& counts = current_[writer_guid];
  ++counts.received;
  counts.lost += lost;
}

std::vector<dds::ScanLosses> ScanLossWindow::losses(Clock::time_point now) const {
  const std::scoped_lock lock(mutex_);
  advance(now);
  Window sums = previous_;
  for (const auto& [writer, counts] : current_) {
    sums[writer].received += counts.received;
    sums[writer].lost += counts.lost;
  }
  std::vector<dds::ScanLosses> found;
  for (const auto& [writer, counts] : sums) {
    if (counts.lost == 0) continue;
    found.push_back({.writer_guid = writer, .received = counts.received, .lost = counts.lost});
  }
  return found;
}

void ScanLossWindow::advance(Clock::time_point now) const {
  if (now - current_since_ < window_length) return;
  const bool is_next = now - current_since_ < 2 * window_length;
  previous_ = is_next ? std::exchange(current_, {}) : Window();
  current_.clear();
  current_since_ = now;
}

}  // namespace stillmap::server
