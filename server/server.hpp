#pragma once

#include <memory>
#include <optional>

#include "config/loaders/server_config.hpp"
#include "idl/interface/topics.hpp"
#include "server/mapping/checkpoint_thread.hpp"
#include "server/mapping/map_saver.hpp"
#include "server/mapping/mapping_thread.hpp"
#include "server/mapping/scan_receiver.hpp"
#include "server/monitoring/discovery_diagnostics.hpp"
#include "server/monitoring/metrics_endpoint.hpp"
#include "server/monitoring/throttled_log.hpp"
#include "server/occupancy/occupancy.hpp"
#include "server/occupancy/occupancy_thread.hpp"
#include "server/publishers/latest_map.hpp"
#include "server/publishers/map_publisher.hpp"
#include "server/publishers/server_report.hpp"
#include "server/publishers/status_publisher.hpp"
#include "server/services/map_services.hpp"
#include "server/services/occupancy_services.hpp"
#include "server/services/removed_voxel_services.hpp"
#include "server/threads/background_throttle.hpp"
#include "server/traversability/traversability_grid.hpp"
#include "server/traversability/traversability_publisher.hpp"
#include "server/traversability/traversability_thread.hpp"

namespace stillmap::server {

/// A running stillmap-server: scans on DDS in; poses, the map and answers out.
class Server {
 public:
  /// Starts everything. Throws DdsError, MapFileError, std::invalid_argument, or what the label
  /// source throws.
  Server(const ServerConfig& config, std::unique_ptr<Segmenter> label_source);
  ~Server();

  /// Ends mapping after the scan in work, and saves the map. Throws MapFileError.
  void stop();

 private:
  [[nodiscard]] dds::ServerStatus status() const;
  void start_mapping(const ServerConfig& config, std::unique_ptr<Segmenter> label_source);
  void start_traversability(const ServerConfig& config);
  void start_services(const ServerConfig& config);
  /// For what is done in the background.
  [[nodiscard]] ThrottleCallback throttle_callback(const ServerConfig& config,
                                                   SaturationPolicy saturation_policy) const;
  void save_in_background();
  void start_metrics(const MetricsConfig& config);

  // In the order of construction; what comes later uses what comes before.
  dds::Topics topics_;
  Statistics statistics_;
  ServiceLog service_log_;
  LatestMap latest_map_;
  ScanQueue queue_;
  BackgroundThrottle throttle_;
  MapSaver saver_;
  TileReader tiles_;
  dds::Participant participant_;
  PosePublisher poses_;
  std::optional<LabelledScanPublisher> scans_;
  std::optional<OdometryPrior> prior_;
  std::optional<OccupancyThread> occupancy_;
  std::unique_ptr<MappingThread> mapping_;
  std::unique_ptr<ScanReceiver> receiver_;
  DiscoveryDiagnostics discovery_diagnostics_;
  ServerReport report_;
  std::unique_ptr<MapPublisher> map_publisher_;
  std::unique_ptr<OctomapPublisher> octomap_publisher_;
  TraversabilitySnapshot traversability_snapshot_;
  TraversabilityCache traversability_cache_;
  TraversabilityGridProvider grid_provider_;
  std::unique_ptr<TraversabilityPublisher> traversability_publisher_;
  std::unique_ptr<TraversabilityThread> traversability_thread_;
  std::unique_ptr<MapServices> services_;
  std::unique_ptr<OccupancyServices> occupancy_services_;
  std::unique_ptr<RemovedVoxelServices> removed_services_;
  std::unique_ptr<StatusPublisher> status_publisher_;
  ThrottledLog save_log_;
  std::unique_ptr<CheckpointThread> autosave_;
  std::unique_ptr<MetricsEndpoint> metrics_;
  ThrottleRelease throttle_release_{throttle_};
};

}  // namespace stillmap::server
