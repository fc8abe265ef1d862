#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "config/loaders/server_config.hpp"
#include "core/frames/odom_frame.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/mapper.hpp"
#include "server/localization/place_finder.hpp"
#include "server/mapping/earth_frame.hpp"
#include "server/mapping/imu_receiver.hpp"
#include "server/mapping/imu_report.hpp"
#include "server/mapping/loop_corrector.hpp"
#include "server/mapping/map_corrector.hpp"
#include "server/mapping/map_saver.hpp"
#include "server/mapping/mapper_factory.hpp"
#include "server/mapping/odometry_prior.hpp"
#include "server/mapping/robot_frames.hpp"
#include "server/mapping/robot_prior.hpp"
#include "server/mapping/scan_queue.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/occupancy/occupancy_thread.hpp"
#include "server/publishers/latest_map.hpp"
#include "server/publishers/scan_publishers.hpp"
#include "server/publishers/submap_publisher.hpp"
#include "server/threads/background_throttle.hpp"
#include "server/threads/request_queue.hpp"
#include "server/threads/worker.hpp"

namespace stillmap::server {

/// Where mapped scans go, and what helps to map them; what is null is switched off.
struct MappingOutputs {
  PosePublisher* poses = nullptr;
  LabelledScanPublisher* scans = nullptr;
  const OdometryPrior* prior = nullptr;
  const StaticTransforms* static_transforms = nullptr;
  ImuReceiver* imu = nullptr;
  OccupancyThread* occupancy = nullptr;
  PlaceFinder* place_finder = nullptr;
  LoopCorrector* loops = nullptr;
  /// Who reads the latest map's tiles.
  TileReader* tiles = nullptr;
  EarthFrame* earth = nullptr;
  SubmapPublisher* submaps = nullptr;
  BackgroundThrottle* throttle = nullptr;
  /// For a lidar that its scans tell.
  OpenSegmenter open_segmenter{};
};

/// What is kept out of the planning view: what of it is in memory, and the tiles that must be read
/// for the rest.
struct RemovedInBox {
  std::vector<RemovedVoxel> voxels;
  std::vector<TileId> on_disk;
  /// Null without a memory limit.
  std::shared_ptr<TileStore> tile_store;
};

/// The one thread that maps: takes scans from the queue, runs the mapper, and publishes the result
/// as the latest map. Its other functions wait for the scan in work, and while the map is
/// corrected.
class MappingThread : public CheckpointSource {
 public:
  /// Resumes `stored` when there is one: its map is extended, and the first scan is expected where
  /// its path ended. Evicted tiles go to `tile_store` and are reloaded from there; when it is null,
  /// none are evicted. Throws std::invalid_argument for a mapper configuration with faults.
  MappingThread(const ServerConfig& config, std::unique_ptr<Segmenter> segmenter,
                const std::optional<SavedMap>& stored, const std::shared_ptr<TileStore>& tile_store,
                ScanQueue& queue, Statistics& statistics, LatestMap& latest_map,
                const MappingOutputs& outputs);
  ~MappingThread() override { stop(); }

  /// Ends after the scan in work. Later calls of the other functions run in the caller's thread.
  void stop();

  /// Drops poses and map, and begins this one. Tiles that are evicted go to `tile_store`.
  void reset(std::uint64_t map_id, const std::shared_ptr<TileStore>& tile_store);
  /// Makes this map ready in the caller's thread, while the running one goes on. What is returned
  /// puts it in the running one's place and cannot fail: the next scan is expected where its path
  /// ended, its non-resident tiles are reloaded from `tile_store`. Throws std::invalid_argument
  /// when its voxels or tiles are not of the configured size.
  [[nodiscard]] std::function<void()> prepare(const SavedMap& stored,
                                              const std::shared_ptr<TileStore>& tile_store);
  /// Publishes what was mapped so far, the scan in work included.
  void publish_now() {
    requests_.run([this] { publish_snapshot(); });
  }

  /// It is also published as the latest map.
  [[nodiscard]] RunCheckpoint checkpoint(CheckpointScope scope) override;
  void checkpoint_stored(std::uint64_t step) override;
  /// A map that fills its memory and cannot be saved is frozen until it can: its tiles are nowhere
  /// else.
  void checkpoint_failed() override;
  [[nodiscard]] MemoryUse memory_use() override;
  /// The map without them is published.
  void forget_lost_tiles() override;
  void stored_is_gone() override;

  /// Voxels in the box (map frame [m]) that are removed from the planning view, in no order. Scans
  /// go on being mapped meanwhile: each tile is as it was at some moment of the call. Throws
  /// std::invalid_argument for a box with more tiles on disk than one answer may read.
  [[nodiscard]] RemovedInBox removed(const Eigen::AlignedBox3d& box_map);
  /// As StaticMap::restore_removed, tile by tile between scans. `make_room` is called where the map
  /// has grown to its memory limit: it is to store the map, so that tiles can be evicted. Throws
  /// as `removed` and `make_room` do, and std::runtime_error when tiles could not be read; what was
  /// restored stays.
  std::size_t restore_removed(RemovalReason reason, const Eigen::AlignedBox3d& box_map,
                              const std::function<void()>& make_room);

 private:
  /// A map that can take the running one's place.
  struct PreparedMap {
    PreparedMap(ResumedMap resumed, SharedTrajectory trajectory, std::shared_ptr<TileStore> store)
        : map(std::move(resumed)),
          path(std::move(trajectory)),
          tile_store(std::move(store)),
          seen_until_ns(server::seen_until_ns(*map.map.view(), path)) {}

    ResumedMap map;
    SharedTrajectory path;
    std::shared_ptr<TileStore> tile_store;
    std::optional<std::int64_t> seen_until_ns;
  };

  void map(QueuedScan queued);
  [[nodiscard]] MapperListeners listeners();
  /// Whether this lidar is not the one that the mapper is told already.
  [[nodiscard]] bool tells_lidar(const std::shared_ptr<const SensorModel>& sensor) const;
  /// Whether it leans as /tf_static tells, which nobody knew when the first labels were opened.
  [[nodiscard]] bool leans_by_published_mount() const;
  /// The lidar that the mapper is to work for from this scan on; null: as before.
  [[nodiscard]] std::shared_ptr<const SensorModel> sensor_of(const QueuedScan& queued) const;
  /// Goes on for this lidar, in map and motion. False where it does already, or nothing is known of
  /// it.
  bool use_sensor(const std::shared_ptr<const SensorModel>& sensor);
  /// Gives the mapper the IMU's samples up to the scan's last point.
  void feed_imu(const Scan& scan);
  /// Runs the requests, and publishes the map when that is due.
  void end_round(bool is_idle);
  /// Loops are looked for in a map that begins empty, or by `in_map` in what is seen from now on of
  /// one that is there.
  void begin_loops(void (LoopCorrector::*in_map)(std::int64_t seen_until_ns),
                   const std::optional<std::int64_t>& seen_until_ns);
  /// The robot was set elsewhere in the map.
  void set_elsewhere();
  /// Has the map moved where a place was seen again, beside mapping.
  void close_loops();
  /// Those of the running map, by poses of the lidar.
  void publish_submaps(const SubmapList& submaps);
  /// Goes on with a map that was moved. False until all scans are in it: nobody else may have it.
  [[nodiscard]] bool take_corrected(bool is_idle);
  /// Waits for a map that is being moved.
  void end_correction();
  /// Path and frames follow a map that was moved.
  void follow(const MapCorrector::Result& result);
  /// Publishes a new map, and starts a new octree from it.
  void begin_map(SharedTrajectory trajectory, const std::optional<std::int64_t>& seen_until_ns);
  void forward(MappedScan mapped);
  void stage_ended(std::string_view stage);
  /// Publishes the pose before the scan is inserted into the map, to keep the latency of poses low.
  void pose_found(std::int64_t stamp_ns, const OdometryResult& odometry);
  /// The stored map, ready for a scan from the end of its path.
  [[nodiscard]] ResumedMap resumed(const SavedMap& stored,
                                   const std::shared_ptr<TileStore>& tile_store) const;
  /// To be called in the thread that maps. The map until now is left in `prepared`: the thread that
  /// asked frees it.
  void exchange(PreparedMap& prepared);
  /// Makes room, freezes the map or lets it grow again, and reports what it takes.
  void bound_memory();
  /// False where it is not known: then the scan is dropped.
  [[nodiscard]] bool locate_lidar(const QueuedScan& queued);
  /// Expected pose of the lidar; nothing where the mapper is to predict it from its own poses.
  [[nodiscard]] std::optional<Eigen::Isometry3d> prior_for(std::int64_t stamp_ns);
  [[nodiscard]] Eigen::Isometry3d T_map_base(const OdometryResult& odometry) const {
    return odometry.T_map_lidar * frames_.T_base_lidar().inverse();
  }
  void tell_of_set_clock(std::int64_t stamp_ns);
  void drop(const ScanRejection& rejection);
  void publish_snapshot();
  /// The tiles that meet the box, and where those are stored that are not in memory.
  struct TilesOfBox {
    std::uint64_t map_id = 0;
    std::vector<TileId> ids;
    std::shared_ptr<TileStore> tile_store;
  };
  [[nodiscard]] TilesOfBox tiles_of(const Eigen::AlignedBox3d& box_map);
  /// Takes tiles from the front of `left` and runs `action` on them in the thread that maps, until
  /// a scan waits or it returns false. Throws std::runtime_error where the map is another one now.
  void run_on_some(std::uint64_t map_id, std::span<const TileId>& left,
                   const std::function<bool(std::span<const TileId> some)>& action);
  /// Limit of the memory that the static map takes.
  std::size_t map_limit_bytes_;
  MapperConfig mapper_config_;
  MapperFactory factory_;
  bool is_live_;
  bool is_map_frozen_ = false;
  /// The one that the configuration names; null where scans tell it.
  std::shared_ptr<const SensorModel> named_sensor_;
  /// The lidar that its scans told, or the named one once labels were opened for how it leans.
  std::shared_ptr<const SensorModel> sensor_;
  double sensor_period_s_;
  std::chrono::duration<double> publish_period_;
  ScanQueue& queue_;
  Statistics& statistics_;
  LatestMap& latest_map_;
  MappingOutputs outputs_;
  Mapper mapper_;
  MapCorrector corrector_;
  /// Of a corrected map, until the scans that were kept meanwhile are in it.
  bool octree_is_behind_ = false;
  /// Where evicted tiles are.
  std::shared_ptr<TileStore> tile_store_;
  ThrottledLog throttled_log_;
  ImuReport imu_report_;
  RobotFrames frames_;
  RobotPrior prior_;
  std::string map_frame_;
  std::string odom_frame_;
  /// Where there is a frame odom of our own.
  std::optional<OdomFrame> odom_;
  /// The frame of the lidar whose place is on /tf_static.
  std::string mounted_frame_;
  /// Of the scan in work: its lidar's motion by the prior.
  std::optional<Eigen::Isometry3d> motion_prior_;
  std::chrono::steady_clock::time_point received_;
  std::chrono::steady_clock::time_point stage_began_;
  double labels_ms_ = 0.0;
  /// Scans in a row with stamps of before the last one.
  int steps_back_ = 0;
  std::chrono::steady_clock::time_point snapshot_published_;
  /// Run after the scan in work.
  RequestQueue requests_;
  // Last: stops before what it uses is gone.
  std::optional<Worker<QueuedScan>> worker_;
};

}  // namespace stillmap::server
