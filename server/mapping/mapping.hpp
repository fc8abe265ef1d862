#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "config/loaders/server_config.hpp"
#include "idl/dds/participant.hpp"
#include "idl/interface/topics.hpp"
#include "server/localization/initial_pose_receiver.hpp"
#include "server/mapping/earth_frame.hpp"
#include "server/mapping/gnss_receiver.hpp"
#include "server/mapping/imu_receiver.hpp"
#include "server/mapping/loop_corrector.hpp"
#include "server/mapping/map_storage.hpp"
#include "server/mapping/mapping_thread.hpp"
#include "server/mapping/odometry_prior.hpp"
#include "server/mapping/scan_queue.hpp"
#include "server/mapping/static_transforms.hpp"
#include "server/publishers/scan_publishers.hpp"

namespace stillmap::server {

/// What the mapping uses of the rest of the server; all of it must outlive the mapping.
struct MappingContext {
  MapStorage& storage;
  dds::Participant& participant;
  const dds::Topics& topics;
  Statistics& statistics;
  BackgroundThrottle& throttle;
  /// Null: no octree.
  OccupancyThread* occupancy = nullptr;
};

/// From queued scans to poses and the static map: the mapping thread with its inputs and outputs,
/// and the checkpoints. Thread-safe.
class Mapping {
 public:
  /// Resumes what the storage has loaded, and starts. Throws DdsError, or std::invalid_argument for
  /// a mapper configuration with faults.
  Mapping(const ServerConfig& config, std::unique_ptr<Segmenter> segmenter,
          OpenSegmenter open_segmenter, const MappingContext& context);

  /// No more checkpoints, mapping ends after the scan in work, and the map is saved. Throws
  /// MapFileError. Without this call the destructor ends mapping, but saves nothing.
  void stop();

  /// Of the segmenter.
  [[nodiscard]] const std::string& label_source() const { return label_source_; }
  [[nodiscard]] ScanQueue& scans() { return scans_; }

  /// As in MappingThread.
  void publish_now() { thread_->publish_now(); }
  [[nodiscard]] RemovedInBox removed(const Eigen::AlignedBox3d& box_map) {
    return thread_->removed(box_map);
  }
  std::size_t restore_removed(RemovalReason reason, const Eigen::AlignedBox3d& box_map) {
    return thread_->restore_removed(reason, box_map, [this] { storage_.saver().make_room(); });
  }

  /// As PlaceFinder.
  [[nodiscard]] LocalizationAnswer localize(const LocalizationQuestion& question) {
    return place_finder_.localize(question);
  }

  /// As MappingThread::reset, for MapSaver::begin_anew.
  void reset(std::uint64_t map_id, const std::shared_ptr<TileStore>& tile_store);
  /// As MappingThread::prepare, for MapSaver::resume_from.
  [[nodiscard]] std::function<void()> prepare(const SavedMap& map,
                                              const std::shared_ptr<TileStore>& tile_store);

 private:
  /// Receivers and publishers of the topics that the configuration names.
  void open_topics(const ServerConfig& config, const MappingContext& context);
  /// Loops, and what a satellite receiver tells of them.
  void open_loops(const ServerConfig& config, const MappingContext& context);
  [[nodiscard]] MappingOutputs outputs(OpenSegmenter open_segmenter, const MappingContext& context);

  std::string label_source_;
  MapStorage& storage_;
  ScanQueue scans_;
  PosePublisher poses_;
  std::optional<LabelledScanPublisher> labelled_scans_;
  std::optional<OdometryPrior> prior_;
  /// Only where the robot has a frame of its own.
  std::optional<StaticTransforms> static_transforms_;
  std::optional<ImuReceiver> imu_;
  PlaceFinder place_finder_;
  std::optional<LoopCorrector> loops_;
  std::optional<GnssReceiver> gnss_;
  std::optional<EarthFrame> earth_;
  std::optional<SubmapPublisher> submaps_;
  std::optional<InitialPoseReceiver> initial_pose_;
  // Each uses what stands above it, and stops before it.
  std::optional<MappingThread> thread_;
  std::optional<CheckpointWorker> checkpoints_;
};

}  // namespace stillmap::server
