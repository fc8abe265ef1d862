#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <stop_token>
#include <string>
#include <vector>

#include "config/loaders/server_config.hpp"
#include "core/lidar/sensor_fit.hpp"
#include "core/lidar/sensor_model.hpp"
#include "core/lidar/sweep_merger.hpp"
#include "core/lidar/turn_joiner.hpp"
#include "idl/conversions/cloud_to_scan.hpp"
#include "idl/dds/reader.hpp"
#include "idl/dds/sample_losses.hpp"
#include "idl/interface/diagnostic.hpp"
#include "sensor_msgs.h"
#include "server/mapping/scan_doubts_report.hpp"
#include "server/mapping/scan_queue.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/publisher_turns.hpp"
#include "server/monitoring/scan_loss_window.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/threads/periodic_worker.hpp"

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
  /// Of each lidar.
  std::vector<PrepareConfig> usable_;
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

  /// Ends soon; the destructor waits for that.
  void request_stop() { worker_.request_stop(); }

  /// Why no scan has arrived yet; empty once one has.
  [[nodiscard]] std::string no_input_reason() const;

  /// About publishers whose scans got lost lately, or that send in turns where one lidar is
  /// expected, and about scans that seem to be other than they are taken for.
  [[nodiscard]] std::vector<dds::Diagnostic> diagnostics() const;

 private:
  using Clock = std::chrono::steady_clock;
  struct Lidar {
    /// Of several: its number.
    std::size_t index = 0;
    std::string name;
    /// Empty: any.
    std::string frame;
    SensorModel sensor;
    wire::CloudReader reader;
    std::uint64_t scans_read = 0;
    /// Where the configuration does not name the lidar.
    std::optional<SensorRecognition> recognition{};
    /// Of the last cloud, and of the one that told the lidar.
    std::string frame_read{};
    std::string frame_told{};
    TurnJoiner turns;
    /// When its last cloud came, and how long after the one before, where there was one.
    std::optional<Clock::time_point> last_cloud{};
    Clock::duration between_clouds{};
    /// Since the last scan.
    bool is_layout_new = false;
  };

  ScanReceiver(dds::Participant& participant, const ServerConfig& config,
               const std::string& ros_topic, std::vector<Lidar> lidars, SweepInput* sweeps,
               ScanQueue& queue, Statistics& statistics);
  [[nodiscard]] static std::vector<Lidar> lidars_on(const ServerConfig& config,
                                                    const std::string& ros_topic);
  /// Ends the turns of lidars of which nothing follows any more.
  void end_overdue_turns(const std::stop_token& stop);
  [[nodiscard]] Lidar* lidar_of(const std::string& frame);
  /// Counts the scans that are missing before this one.
  void count_losses(const eprosima::fastrtps::rtps::SampleIdentity& scan);
  /// Clouds that the reader passed over: they arrived, and are none.
  void drop_unreadable();
  void accept(const sensor_msgs::msg::PointCloud2& cloud, const std::stop_token& stop);
  /// Counts ids that SemanticKITTI does not have, and says once where its ids are none.
  void report_labels(const Lidar& lidar, const LabelCensus& census);
  /// Counts clouds of another frame than that of those which told the lidar.
  void report_frame(const Lidar& lidar);
  /// Logs changes of the cloud's layout.
  void report_layout(Lidar& lidar, const std::string& cloud_changes);
  /// Now and then checks that scans fit the sensor model.
  void report(Lidar& lidar, const Scan& scan);
  /// Joins clouds that are parts of a turn.
  void take(Lidar& lidar, Scan cloud, const std::string& frame, const std::stop_token& stop);
  /// What waits for other parts of its turn, which do not come.
  void end_turn(Lidar& lidar, const std::stop_token& stop);
  void pass_on(Lidar& lidar, std::vector<Scan> scans, const std::stop_token& stop);
  /// By the scan, where it tells the lidar. Of two on one topic, none tells what the other is.
  static void recognise(Lidar& lidar, const Scan& scan);
  void queue_scan(QueuedScan queued, const std::stop_token& stop);
  void drop(const std::string& reason, std::size_t count, const std::string& detail);

  std::string topic_;
  const dds::Participant& participant_;
  DeliveryMode delivery_;
  std::uint32_t clouds_per_turn_;
  std::vector<Lidar> lidars_;
  /// Null: one lidar.
  SweepInput* sweeps_;
  std::atomic<bool> has_received_ = false;
  ScanQueue& queue_;
  Statistics& statistics_;
  ThrottledLog throttled_log_;
  /// What was told of clouds.
  NewLines layouts_;
  ScanDoubtsReport doubts_;
  dds::SampleLosses losses_;
  ScanLossWindow recent_losses_;
  PublisherTurns turns_;
  dds::Reader<sensor_msgs::msg::PointCloud2> reader_;
  // Last: stops before what it uses is gone.
  PeriodicWorker worker_;
};

}  // namespace stillmap::server
