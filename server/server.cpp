#include "server/server.hpp"

#include <spdlog/spdlog.h>

#include "idl/dds/transports.hpp"

namespace stillmap {
namespace {

DdsOptions server_options(const DdsConfig& config) {
  DdsOptions options = dds_options(config.network, DdsRole::server);
  options.domain_id = config.domain_id;
  options.node_name = config.participant_name;
  options.ros_gid_bytes = config.ros_gid_bytes;
  options.security = config.security;
  return options;
}

std::map<std::string, std::string> file_metadata(const ServerConfig& config,
                                                 const LabelSource& labels) {
  std::map<std::string, std::string> metadata{
      {"software", std::string("stillmap ") + STILLMAP_VERSION},
      {"sensor", config.mapper.sensor.name},
      {"label_source", labels.name()}};
  if (!config.map.datum.empty()) metadata["datum"] = config.map.datum;
  return metadata;
}

void log(const Finding& finding) {
  spdlog::warn("{}: {}; {}", finding.what, finding.evidence, finding.way_out);
}

/// What is wrong with this machine.
std::vector<Finding> troubles(std::uint32_t wanted_bytes) {
  const std::uint32_t granted = granted_socket_buffer_bytes(wanted_bytes);
  if (granted >= wanted_bytes) return {};
  const Finding trouble{.severity = Severity::advice,
                        .what = "UDP buffers are too small: large clouds over UDP can get lost",
                        .evidence = "they have " + std::to_string(granted) + " bytes instead of " +
                                    std::to_string(wanted_bytes),
                        .way_out = "sudo sysctl net.core.rmem_max=" + std::to_string(wanted_bytes)};
  log(trouble);
  return {trouble};
}

ServerTraits traits(const ServerConfig& config, const LabelSource& labels,
                    const DdsOptions& options) {
  return {.delivery = delivery_mode(config.input.delivery),
          .label_source = labels.name(),
          .sensor = config.mapper.sensor.name,
          .points_topic = config.topics.points,
          .troubles = troubles(options.socket_buffer_bytes)};
}

std::optional<StoredMap> stored_map(MapSaver& saver, const MapFileConfig& config) {
  if (!config.load_at_start) return std::nullopt;
  auto stored = saver.load();
  if (stored && !stored->view.tiles.empty()) {
    spdlog::info("going on with {}: {} tiles, {} poses", config.file.string(),
                 stored->view.tiles.size(), stored->trajectory.size());
  }
  return stored;
}

}  // namespace

Server::Server(const ServerConfig& config, std::unique_ptr<LabelSource> label_source)
    : topics_(Topics::in(config.topics.name_space)),
      queue_(config.input.queue_length),
      saver_(board_, config.map.file, file_metadata(config, *label_source),
             config.map.memory_limit_mib),
      tiles_(saver_.shelf(), (std::size_t{config.map.memory_limit_mib} << 20) / 8),
      participant_(server_options(config.dds)),
      poses_(participant_, topics_, config.frames),
      peer_report_(participant_, log),
      report_(
          traits(config, *label_source, participant_.options()), board_, statistics_,
          [this] { return peer_report_.findings(); },
          [this] { return receiver_->why_nothing_arrives(); }),
      atlas_(area_board_, board_, tiles_),
      planning_grid_(config.areas, config.frames.map, board_, area_board_) {
  start_mapping(config, std::move(label_source));
  receiver_ = std::make_unique<ScanReceiver>(participant_, config, queue_, statistics_);
  map_publisher_ = std::make_unique<MapPublisher>(participant_, topics_, config, board_);
  if (occupancy_) {
    octomap_publisher_ =
        std::make_unique<OctomapPublisher>(participant_, topics_, config, *occupancy_);
  }
  start_areas(config);
  start_services(config);
  autosave_ = std::make_unique<CheckpointThread>(
      std::chrono::duration<double>(config.map.save_period_s), [this] { save_in_background(); });
  start_metrics(config.metrics);
}

Server::~Server() = default;

Pause Server::give_way(const ServerConfig& config, WithoutGaps without_gaps) const {
  // Where every scan counts, poses may come later, so that octree and areas keep up.
  if (config.input.delivery == Delivery::every) return {};
  return give_way_to(scan_traffic_, without_gaps);
}

void Server::stop() {
  scan_traffic_.end();
  // Who asks goes first, then who brings, then who maps: nobody waits for somebody gone.
  metrics_.reset();
  autosave_.reset();
  services_.reset();
  occupancy_services_.reset();
  removed_services_.reset();
  status_publisher_.reset();
  receiver_.reset();
  // They get little time while scans come.
  octomap_publisher_.reset();
  areas_.reset();
  mapping_->stop();
  saver_.save_at_end();
}

void Server::start_mapping(const ServerConfig& config, std::unique_ptr<LabelSource> label_source) {
  if (config.publish.scan) scans_.emplace(participant_, topics_);
  if (!config.topics.odometry_prior.empty()) {
    prior_.emplace(participant_, config.topics.odometry_prior);
  }
  if (config.occupancy.enabled) {
    // An octree that misses scans is better than late poses.
    occupancy_.emplace(config.occupancy, statistics_, give_way(config, WithoutGaps::wait));
  }
  const MappingOutputs outputs{.poses = &poses_,
                               .scans = scans_ ? &*scans_ : nullptr,
                               .prior = prior_ ? &*prior_ : nullptr,
                               .occupancy = occupancy_ ? &*occupancy_ : nullptr,
                               .traffic = &scan_traffic_};
  mapping_ = std::make_unique<MappingThread>(config, std::move(label_source),
                                             stored_map(saver_, config.map), saver_.shelf(), queue_,
                                             statistics_, board_, outputs);
  saver_.follow({.take = [this](bool everything) { return mapping_->checkpoint(everything); },
                 .stored = [this](std::uint64_t step) { mapping_->checkpoint_stored(step); },
                 .map_bytes = [this] { return mapping_->memory_use().bytes; }});
}

void Server::start_services(const ServerConfig& config) {
  const auto status = [this] { return this->status(); };
  const ServiceContext context{
      .board = board_,
      .tiles = tiles_,
      .saver = saver_,
      .status = status,
      .reset = [this] { return mapping_->reset(); },
      .load =
          [this](const StoredMap& stored, const std::shared_ptr<TileShelf>& shelf) {
            mapping_->load(stored, shelf);
            tiles_.use_shelf(shelf);
          },
      .show_now = [this] { mapping_->show_now(); },
      .areas = atlas_,
      .planning_grid = planning_grid_,
      .log = service_log_};
  const Services names = Services::in(config.topics.name_space);
  services_ = std::make_unique<ServiceDesk>(participant_, names, context);
  occupancy_services_ = std::make_unique<OccupancyDesk>(
      participant_, names, context, occupancy_ ? &*occupancy_ : nullptr, config.frames.map);
  const RemovedSource removed{
      .removed = [this](const Eigen::AlignedBox3d& box_map) { return mapping_->removed(box_map); },
      .restore =
          [this](RemovalReason reason, const Eigen::AlignedBox3d& box_map) {
            return mapping_->restore_removed(reason, box_map);
          }};
  removed_services_ = std::make_unique<RemovedDesk>(participant_, names, context, removed);
  status_publisher_ = std::make_unique<StatusPublisher>(participant_, topics_,
                                                        config.publish.status_period_s, status);
}

ServerStatus Server::status() const {
  ServerStatus status = report_.status();
  for (const auto& [name, value] : participant_.service_faults().counts()) {
    status.counters.push_back({.name = name, .value = value});
  }
  return status;
}

void Server::start_areas(const ServerConfig& config) {
  std::vector<RobotProfile> robots = robots_of(config.areas);
  if (robots.empty()) return;
  if (!config.areas.grid_profile.empty()) {
    area_publisher_ = std::make_unique<AreaPublisher>(participant_, topics_, planning_grid_);
  }
  const auto publish = [this] {
    if (area_publisher_) area_publisher_->publish();
  };
  areas_ = std::make_unique<AreaThread>(
      std::move(robots), std::chrono::duration<double>(config.areas.update_period_s), board_,
      area_board_, statistics_, publish, give_way(config, WithoutGaps::work_a_tenth));
}

void Server::start_metrics(const MetricsConfig& config) {
  if (config.address.empty()) return;
  metrics_ = std::make_unique<MetricsEndpoint>(config.address, [this]() -> MetricsSnapshot {
    return {.status = report_.status(),
            .stages = statistics_.stage_times(),
            .services = service_log_.services(),
            .checkpoints = saver_.checkpoints(),
            .map_memory = statistics_.map_memory(),
            .process = process_use()};
  });
  spdlog::info("metrics: http://{}/metrics", metrics_->address());
}

void Server::save_in_background() {
  try {
    saver_.save_if_changed();
  } catch (const MapFileError& error) {
    save_warnings_.error("save", std::string("the map was not saved: ") + error.what());
  }
}

}  // namespace stillmap
