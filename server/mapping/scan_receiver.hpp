#pragma once

#include <stop_token>
#include <string>
#include <thread>

#include "config/loaders/server_config.hpp"
#include "core/lidar/sensor_model.hpp"
#include "idl/conversions/cloud_reader.hpp"
#include "idl/dds/reader.hpp"
#include "sensor_msgs.h"
#include "server/monitoring/statistics.hpp"
#include "server/monitoring/throttled_log.hpp"
#include "server/threads/bounded_queue.hpp"

namespace stillmap::server {

[[nodiscard]] dds::DeliveryMode delivery_mode(Delivery delivery);

/// Takes clouds from DDS, makes scans of them, and queues them for the mapper.
class ScanReceiver {
 public:
  ScanReceiver(dds::Participant& participant, const ServerConfig& config, ScanQueue& queue,
               Statistics& statistics);

  /// Why no scan arrives, seen from here; empty when scans do arrive.
  [[nodiscard]] std::string no_input_reason() const;

 private:
  void receive(const std::stop_token& stop);
  void accept(const sensor_msgs::msg::PointCloud2& cloud, const std::stop_token& stop);
  /// Tells what is new about the clouds, and now and then whether they can be the sensor's.
  void report(const std::string& cloud_changes, const Scan& scan);
  void drop(const std::string& reason, std::size_t count, const std::string& detail);

  std::string topic_;
  std::uint32_t domain_id_;
  dds::DeliveryMode delivery_;
  SensorModel sensor_;
  wire::CloudReader cloud_reader_;
  std::uint64_t scans_read_ = 0;
  ScanQueue& queue_;
  Statistics& statistics_;
  ThrottledLog throttled_log_;
  dds::Reader<sensor_msgs::msg::PointCloud2> reader_;
  // Last: stops before what it uses is gone.
  std::jthread thread_;
};

}  // namespace stillmap::server
