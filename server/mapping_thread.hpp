#pragma once

#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "config/server_config.hpp"
#include "core/map/map_file.hpp"
#include "core/mapper.hpp"
#include "server/map_board.hpp"
#include "server/occupancy_thread.hpp"
#include "server/odometry_prior.hpp"
#include "server/publishers/labelled_scan_publisher.hpp"
#include "server/publishers/pose_publisher.hpp"
#include "server/rare_warnings.hpp"
#include "server/scan_queue.hpp"
#include "server/statistics.hpp"

namespace stillmap {

/// Where mapped scans go; what is null is switched off.
struct MappingOutputs {
  PosePublisher* poses = nullptr;
  LabelledScanPublisher* scans = nullptr;
  const OdometryPrior* prior = nullptr;
  OccupancyThread* occupancy = nullptr;
};

/// The one thread that maps: takes scans from the queue, runs the mapper, and shows what became of
/// them on the board.
class MappingThread {
 public:
  /// Throws std::invalid_argument for a mapper configuration with faults. Goes on with `stored`
  /// when there is one: its map is extended, and the first scan is expected where it ended.
  MappingThread(const ServerConfig& config, std::unique_ptr<LabelSource> label_source,
                const std::optional<StoredMap>& stored, ScanQueue& queue, Statistics& statistics,
                MapBoard& board, const MappingOutputs& outputs);

  /// Forgets poses and map, after the scan in work; returns the id of the new map.
  [[nodiscard]] std::uint64_t reset();
  /// Shows on the board what was mapped so far, the scan in work included.
  void show_now();

 private:
  void work(const std::stop_token& stop);
  void map(QueuedScan queued);
  /// Shows a new map, and has the octree begin with it.
  void begin_map(Trajectory trajectory);
  void hand_on(MappedScan mapped, const std::string& frame);
  void stage_ended(std::string_view stage);
  [[nodiscard]] std::optional<Eigen::Isometry3d> prior_for(std::int64_t stamp_ns) const;
  void show_view();
  /// Runs it in the thread that maps, after the scan in work, and waits for that.
  void between_scans(std::function<void()> action);
  void run_asked();

  std::string lidar_frame_;
  std::chrono::duration<double> view_period_;
  ScanQueue& queue_;
  Statistics& statistics_;
  MapBoard& board_;
  MappingOutputs outputs_;
  Mapper mapper_;
  RareWarnings warnings_;
  std::chrono::steady_clock::time_point stage_began_;
  double labels_ms_ = 0.0;
  std::chrono::steady_clock::time_point view_shown_;
  std::mutex asked_mutex_;
  std::vector<std::packaged_task<void()>> asked_;
  // Last: stops before what it uses is gone.
  std::jthread thread_;
};

}  // namespace stillmap
