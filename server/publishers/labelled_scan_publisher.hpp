#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "core/lidar/labelled_scan.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "sensor_msgs.h"

namespace stillmap::server {

/// Publishes labelled scans from its own thread; while one is being written, only the newest of
/// the next ones is kept.
class LabelledScanPublisher {
 public:
  LabelledScanPublisher(dds::Participant& participant, const dds::Topics& topics);

  /// Returns at once.
  void publish(std::shared_ptr<const LabelledScan> labelled, const std::string& lidar_frame);

 private:
  struct Job {
    std::shared_ptr<const LabelledScan> labelled;
    std::string lidar_frame;
  };

  void work(const std::stop_token& stop);

  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::optional<Job> newest_;
  dds::Writer<sensor_msgs::msg::PointCloud2> writer_;
  // Last: stops before what it uses is gone.
  std::jthread thread_;
};

}  // namespace stillmap::server
