#pragma once

#include <memory>
#include <optional>

#include "config/server_config.hpp"
#include "idl/topics.hpp"
#include "server/area_thread.hpp"
#include "server/checkpoint_thread.hpp"
#include "server/map_board.hpp"
#include "server/map_saver.hpp"
#include "server/mapping_thread.hpp"
#include "server/metrics/metrics_endpoint.hpp"
#include "server/occupancy_thread.hpp"
#include "server/peer_report.hpp"
#include "server/planning_grid.hpp"
#include "server/publishers/area_publisher.hpp"
#include "server/publishers/map_publisher.hpp"
#include "server/publishers/octomap_publisher.hpp"
#include "server/publishers/status_publisher.hpp"
#include "server/rare_warnings.hpp"
#include "server/scan_receiver.hpp"
#include "server/scan_traffic.hpp"
#include "server/server_report.hpp"
#include "server/services/occupancy_desk.hpp"
#include "server/services/removed_desk.hpp"
#include "server/services/service_desk.hpp"

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
