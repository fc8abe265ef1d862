#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>

#include "core/lidar/scan.hpp"

namespace stillmap::server {

/// A scan on its way to the mapper.
struct QueuedScan {
  Scan scan;
  /// header.frame_id of its cloud.
  std::string frame;
  std::chrono::steady_clock::time_point received;
};

/// A bounded queue between the thread that receives and the one that maps.
class ScanQueue {
 public:
  /// `capacity` >= 1.
  explicit ScanQueue(std::size_t capacity) : capacity_(capacity) {}

  /// Makes room by dropping the oldest scans; returns how many.
  std::size_t push_dropping_oldest(QueuedScan scan);

  /// Waits for room. False when a stop was requested: the scan was not taken.
  [[nodiscard]] bool push_blocking(QueuedScan scan, const std::stop_token& stop);

  /// Waits for a scan. Nothing after `timeout` or when a stop was requested.
  [[nodiscard]] std::optional<QueuedScan> pop(const std::stop_token& stop,
                                              std::chrono::milliseconds timeout);

  /// How many scans wait to be taken.
  [[nodiscard]] std::size_t waiting() const;

 private:
  const std::size_t capacity_;
  mutable std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<QueuedScan> scans_;
};

}  // namespace stillmap::server
