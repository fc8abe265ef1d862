#pragma once

#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "config/loaders/server_config.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/mapper.hpp"
#include "server/mapping/map_saver.hpp"
#include "server/mapping/odometry_prior.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/monitoring/throttled_log.hpp"
#include "server/occupancy/occupancy_thread.hpp"
#include "server/publishers/labelled_scan_publisher.hpp"
#include "server/publishers/latest_map.hpp"
#include "server/publishers/scan_publishers.hpp"
#include "server/threads/background_throttle.hpp"
#include "server/threads/bounded_queue.hpp"

namespace stillmap::server {

/// Where mapped scans go; what is null is switched off.
struct MappingOutputs {
  PosePublisher* poses = nullptr;
  LabelledScanPublisher* scans = nullptr;
  const OdometryPrior* prior = nullptr;
  OccupancyThread* occupancy = nullptr;
  BackgroundThrottle* throttle = nullptr;
};

/// The one thread that maps: takes scans from the queue, runs the mapper, and publishes what
/// became of them as the latest map.
class MappingThread {
 public:
  /// Throws std::invalid_argument for a mapper configuration with faults. Goes on with `stored`
  /// when there is one: its map is extended, and the first scan is expected where it ended. Tiles
  /// that are non-resident come from `tile_store`, to which they may go when it is not null.
  MappingThread(const ServerConfig& config, std::unique_ptr<Segmenter> label_source,
                const std::optional<SavedMap>& stored, const std::shared_ptr<TileStore>& tile_store,
                ScanQueue& queue, Statistics& statistics, LatestMap& latest_map,
                const MappingOutputs& outputs);

  /// Maps no more. What follows is done in the caller's thread.
  void stop();

  /// Forgets poses and map, after the scan in work; returns the id of the new map.
  [[nodiscard]] std::uint64_t reset();
  /// Goes on with this map, after the scan in work: the next scan is expected where its path ended.
  /// Tiles that are non-resident come from `tile_store`. Throws std::invalid_argument when its
  /// voxels or tiles are not of the configured size; then nothing changed.
  void load(const SavedMap& stored, const std::shared_ptr<TileStore>& tile_store);
  /// Publishes what was mapped so far, the scan in work included.
  void publish_now();

  /// What changed since what was stored last, or everything, and the path to it; it is also
  /// published as the latest map.
  [[nodiscard]] RunCheckpoint checkpoint(bool everything);
  /// Everything up to this step of a checkpoint is stored: far tiles may leave memory.
  void checkpoint_stored(std::uint64_t step);
  [[nodiscard]] MemoryUse memory_use();

  /// As StaticMap has them.
  [[nodiscard]] std::vector<RemovedVoxel> removed(const Eigen::AlignedBox3d& box_map);
  std::size_t restore_removed(RemovalReason reason, const Eigen::AlignedBox3d& box_map);

 private:
  void work(const std::stop_token& stop);
  void map(QueuedScan queued);
  /// Shows a new map, and has the octree begin with it.
  void begin_map(Trajectory trajectory);
  void forward(MappedScan mapped);
  void stage_ended(std::string_view stage);
  /// At once, before the map takes the scan: clients wait for it.
  void pose_found(std::int64_t stamp_ns, const OdometryResult& odometry);
  /// In the thread that maps.
  void resume(const SavedMap& stored, const std::shared_ptr<TileStore>& tile_store);
  [[nodiscard]] std::optional<Eigen::Isometry3d> prior_for(std::int64_t stamp_ns) const;
  void publish_snapshot();
  /// Runs it in the thread that maps, after the scan in work, and waits for that.
  void run_between_scans(std::function<void()> action);
  void run_requests();

  /// For what the map itself takes.
  std::size_t map_limit_bytes_;
  std::string lidar_frame_;
  std::chrono::duration<double> publish_period_;
  ScanQueue& queue_;
  Statistics& statistics_;
  LatestMap& latest_map_;
  MappingOutputs outputs_;
  Mapper mapper_;
  ThrottledLog throttled_log_;
  /// Of the scan in work.
  std::string frame_;
  std::chrono::steady_clock::time_point received_;
  std::chrono::steady_clock::time_point stage_began_;
  double labels_ms_ = 0.0;
  std::chrono::steady_clock::time_point snapshot_published_;
  std::mutex requests_mutex_;
  bool has_stopped_ = false;
  std::vector<std::packaged_task<void()>> requests_;
  // Last: stops before what it uses is gone.
  std::jthread thread_;
};

}  // namespace stillmap::server
