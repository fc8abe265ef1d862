#include "server/threads/bounded_queue.hpp"

#include <utility>

namespace stillmap::server {

std::size_t ScanQueue::push_dropping_oldest(QueuedScan scan) {
  const std::scoped_lock lock(mutex_);
  std::size_t dropped = 0;
  for (; scans_.size() >= capacity_; ++dropped) scans_.pop_front();
  scans_.push_back(std::move(scan));
  changed_.notify_all();
  return dropped;
}

bool ScanQueue::push_blocking(QueuedScan scan, const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  if (!changed_.wait(lock, stop, [this] { return scans_.size() < capacity_; })) return false;
  scans_.push_back(std::move(scan));
  changed_.notify_all();
  return true;
}

std::optional<QueuedScan> ScanQueue::pop(const std::stop_token& stop,
                                         std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, stop, timeout, [this] { return !scans_.empty(); });
  if (scans_.empty() || stop.stop_requested()) return std::nullopt;
  QueuedScan scan = std::move(scans_.front());
  scans_.pop_front();
  changed_.notify_all();
  return scan;
}

std::size_t ScanQueue::waiting() const {
  const std::scoped_lock lock(mutex_);
  return scans_.size();
}

}  // namespace stillmap::server
