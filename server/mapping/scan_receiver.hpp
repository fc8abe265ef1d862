#pragma once

#include <atomic>
#include <stop_token>
#include <string>
#include <vector>

#include "config/loaders/server_config.hpp"
#include "core/lidar/sensor_model.hpp"
#include "idl/conversions/cloud_to_scan.hpp"
#include "idl/dds/reader.hpp"
#include "idl/dds/sample_losses.hpp"
#include "idl/interface/diagnostic.hpp"
#include "sensor_msgs.h"
#include "server/mapping/scan_queue.hpp"
#include "server/mapping/sweep_input.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/scan_loss_window.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/threads/periodic_worker.hpp"

namespace stillmap::server {

/// Takes clouds of one topic from DDS, makes scans of them, and queues them for the mapper.
class ScanReceiver {
 public:
  /// For the one lidar of a robot, on `topics.points`.
  ScanReceiver(dds::Participant& participant, const ServerConfig& config, ScanQueue& queue,
               Statistics& statistics);
  /// For those of several lidars whose topic it is; their scans go to `sweeps`.
  ScanReceiver(dds::Participant& participant, const ServerConfig& config,
               const std::string& ros_topic, SweepInput& sweeps, ScanQueue& queue,
               Statistics& statistics);

  /// Why no scan has arrived yet; empty once one has.
  [[nodiscard]] std::string no_input_reason() const;

  /// About publishers whose scans got lost lately.
  [[nodiscard]] std::vector<dds::Diagnostic> loss_diagnostics() const;

 private:
  struct Lidar {
    /// Of several: its number.
    std::size_t index = 0;
    std::string name;
    /// Empty: any.
    std::string frame;
    SensorModel sensor;
    wire::CloudReader reader;
    std::uint64_t scans_read = 0;
  };

  ScanReceiver(dds::Participant& participant, const ServerConfig& config,
               const std::string& ros_topic, std::vector<Lidar> lidars, SweepInput* sweeps,
               ScanQueue& queue, Statistics& statistics);
  [[nodiscard]] static std::vector<Lidar> lidars_on(const ServerConfig& config,
                                                    const std::string& ros_topic);
  [[nodiscard]] Lidar* lidar_of(const std::string& frame);
  /// Counts the scans that are missing before this one.
  void count_losses(const eprosima::fastrtps::rtps::SampleIdentity& scan);
  void accept(const sensor_msgs::msg::PointCloud2& cloud, const std::stop_token& stop);
  /// Logs changes of the cloud's layout, and now and then checks that scans fit the sensor model.
  void report(Lidar& lidar, const std::string& cloud_changes, const Scan& scan);
  void queue_scan(QueuedScan queued, const std::stop_token& stop);
  void drop(const std::string& reason, std::size_t count, const std::string& detail);

  std::string topic_;
  const dds::Participant& participant_;
  DeliveryMode delivery_;
  std::vector<Lidar> lidars_;
  /// Null: one lidar.
  SweepInput* sweeps_;
  std::atomic<bool> has_received_ = false;
  ScanQueue& queue_;
  Statistics& statistics_;
  ThrottledLog throttled_log_;
  dds::SampleLosses losses_;
  ScanLossWindow recent_losses_;
  dds::Reader<sensor_msgs::msg::PointCloud2> reader_;
  // Last: stops before what it uses is gone.
  PeriodicWorker worker_;
};

}  // namespace stillmap::server
