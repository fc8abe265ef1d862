#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <stop_token>
#include <string>
#include <vector>

#include "config/loaders/server_config.hpp"
#include "core/lidar/sweep_merger.hpp"
#include "server/mapping/scan_queue.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"

namespace stillmap::server {

/// Makes one scan of those that several lidars took at a time, and queues it for the mapper.
/// Thread-safe: each lidar has a thread.
class SweepInput {
 public:
  SweepInput(const ServerConfig& config, ScanQueue& queue, Statistics& statistics);

  /// Takes a scan of one lidar, in the lidar's frame. With delivery `every` it waits, until a stop
  /// is requested, while this lidar is ahead of others or the mapper is busy.
  void add(std::size_t lidar, Scan scan, const std::stop_token& stop);

  /// Queues sweeps that have waited long enough; to be called now and then.
  void queue_overdue(const std::stop_token& stop);

 private:
  using Clock = std::chrono::steady_clock;

  [[nodiscard]] double now_s() const;
  /// With the mutex locked.
  void queue_sweeps(const std::stop_token& stop);
  void queue(SweepMerger::Sweep sweep, const std::stop_token& stop);
  void drop(const std::string& reason, std::size_t count, const std::string& detail);

  std::vector<LidarConfig> lidars_;
  PrepareConfig usable_;
  std::vector<Eigen::Isometry3d> T_merged_lidars_;
  std::string frame_;
  DeliveryMode delivery_;
  ScanQueue& queue_;
  Statistics& statistics_;
  Clock::time_point began_ = Clock::now();
  std::mutex mutex_;
  std::condition_variable_any sweeps_changed_;
  ThrottledLog throttled_log_;
  SweepMerger merger_;
};

}  // namespace stillmap::server
