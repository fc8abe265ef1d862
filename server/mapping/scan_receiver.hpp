#pragma once

#include <stop_token>
#include <string>

#include "config/loaders/server_config.hpp"
#include "core/lidar/sensor_model.hpp"
#include "idl/conversions/cloud_to_scan.hpp"
#include "idl/dds/reader.hpp"
#include "sensor_msgs.h"
#include "server/mapping/scan_queue.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/threads/periodic_worker.hpp"

namespace stillmap::server {

/// Takes clouds from DDS, makes scans of them, and queues them for the mapper.
class ScanReceiver {
 public:
  ScanReceiver(dds::Participant& participant, const ServerConfig& config, ScanQueue& queue,
               Statistics& statistics);

  /// Why no scan has arrived yet; empty once one has.
  [[nodiscard]] std::string no_input_reason() const;

 private:
  void accept(const sensor_msgs::msg::PointCloud2& cloud, const std::stop_token& stop);
  /// Logs changes of the cloud's layout, and now and then checks that scans fit the sensor model.
  void report(const std::string& cloud_changes, const Scan& scan);
  void drop(const std::string& reason, std::size_t count, const std::string& detail);

  std::string topic_;
  std::uint32_t domain_id_;
  DeliveryMode delivery_;
  SensorModel sensor_;
  wire::CloudReader cloud_reader_;
  std::uint64_t scans_read_ = 0;
  ScanQueue& queue_;
  Statistics& statistics_;
  ThrottledLog throttled_log_;
  dds::Reader<sensor_msgs::msg::PointCloud2> reader_;
  // Last: stops before what it uses is gone.
  PeriodicWorker worker_;
};

}  // namespace stillmap::server
