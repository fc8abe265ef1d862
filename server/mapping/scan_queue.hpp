#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "core/lidar/scan.hpp"
#include "core/lidar/sensor_model.hpp"
#include "server/threads/bounded_queue.hpp"

namespace stillmap::server {

/// A scan on its way to the mapper.
struct QueuedScan {
  Scan scan;
  /// header.frame_id of its cloud.
  std::string frame;
  std::chrono::steady_clock::time_point received;
  /// The lidar, where its scans have told it.
  std::shared_ptr<const SensorModel> sensor{};
};

/// Between the thread that receives scans and the one that maps them.
using ScanQueue = BoundedQueue<QueuedScan>;

}  // namespace stillmap::server
