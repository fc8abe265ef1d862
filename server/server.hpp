#pragma once

#include <memory>
#include <optional>

#include "config/loaders/server_config.hpp"
#include "idl/interface/topics.hpp"
#include "server/traversability/traversability_thread.hpp"
#include "server/mapping/checkpoint_thread.hpp"
#include "server/publishers/latest_map.hpp"
#include "server/mapping/map_saver.hpp"
#include "server/mapping/mapping_thread.hpp"
#include "server/monitoring/metrics_endpoint.hpp"
#include "server/occupancy/occupancy_thread.hpp"
#include "server/monitoring/discovery_diagnostics.hpp"
#include "server/traversability/traversability_grid_provider.hpp"
#include "server/traversability/traversability_publisher.hpp"
#include "server/publishers/map_publisher.hpp"
#include "server/occupancy/octomap_publisher.hpp"
#include "server/publishers/status_publisher.hpp"
#include "server/monitoring/throttled_log.hpp"
#include "server/mapping/scan_receiver.hpp"
#include "server/mapping/background_throttle.hpp"
#include "server/publishers/server_report.hpp"
#include "server/services/occupancy_services.hpp"
#include "server/services/removed_voxel_services.hpp"
#include "server/services/map_services.hpp"

namespace stillmap {

/// A running stillmap-server: scans on DDS in; poses, the map and answers out.
class Server {
 public:
  /// Starts everything. Throws DdsError, MapFileError, std::invalid_argument, or what the label
  /// source throws.
  Server(const ServerConfig& config, std::unique_ptr<LabelSource> label_source);
  ~Server();

  /// Ends mapping after the scan in work, and saves the map. Throws MapFileError.
  void stop();

 private:
  [[nodiscard]] ServerStatus status() const;
  void start_mapping(const ServerConfig& config, std::unique_ptr<LabelSource> label_source);
  void start_areas(const ServerConfig& config);
  void start_services(const ServerConfig& config);
  /// For what is done in the background.
  [[nodiscard]] Pause give_way(const ServerConfig& config, WithoutGaps without_gaps) const;
  void save_in_background();
  void start_metrics(const MetricsConfig& config);

  // In the order of construction; what comes later uses what comes before.
  Topics topics_;
  Statistics statistics_;
  ServiceLog service_log_;
  MapBoard board_;
  ScanQueue queue_;
  ScanTraffic scan_traffic_;
  MapSaver saver_;
  TileReader tiles_;
  Participant participant_;
  PosePublisher poses_;
  std::optional<LabelledScanPublisher> scans_;
  std::optional<OdometryPrior> prior_;
  std::optional<OccupancyThread> occupancy_;
  std::unique_ptr<MappingThread> mapping_;
  std::unique_ptr<ScanReceiver> receiver_;
  PeerReport peer_report_;
  ServerReport report_;
  std::unique_ptr<MapPublisher> map_publisher_;
  std::unique_ptr<OctomapPublisher> octomap_publisher_;
  AreaBoard area_board_;
  AreaAtlas atlas_;
  PlanningGrid planning_grid_;
  std::unique_ptr<AreaPublisher> area_publisher_;
  std::unique_ptr<AreaThread> areas_;
  std::unique_ptr<ServiceDesk> services_;
  std::unique_ptr<OccupancyDesk> occupancy_services_;
  std::unique_ptr<RemovedDesk> removed_services_;
  std::unique_ptr<StatusPublisher> status_publisher_;
  RareWarnings save_warnings_;
  std::unique_ptr<CheckpointThread> autosave_;
  std::unique_ptr<MetricsEndpoint> metrics_;
  TrafficEnd traffic_end_{scan_traffic_};
};

}  // namespace stillmap
