#include "server/server.hpp"

#include <spdlog/spdlog.h>

#include "idl/dds/transports.hpp"

namespace stillmap::server {
namespace {

dds::DdsOptions server_options(const DdsConfig& config) {
  dds::DdsOptions options = dds_options(config.network, DdsRole::server);
  options.domain_id = config.domain_id;
  options.node_name = config.participant_name;
  options.ros_gid_bytes = config.ros_gid_bytes;
  options.security = config.security;
  return options;
}

std::map<std::string, std::string> file_metadata(const ServerConfig& config,
                                                 const Segmenter& labels) {
  std::map<std::string, std::string> metadata{
      {"software", std::string("stillmap ") + STILLMAP_VERSION},
      {"sensor", config.mapper.sensor.name},
      {"label_source", labels.name()}};
  if (!config.map.datum.empty()) metadata["datum"] = config.map.datum;
  return metadata;
}

void log(const dds::Diagnostic& diagnostic) {
  spdlog::warn("{}: {}; {}", diagnostic.what, diagnostic.evidence, diagnostic.hint);
}

/// What is wrong with this machine.
std::vector<dds::Diagnostic> host_diagnostics(std::uint32_t wanted_bytes) {
  const std::uint32_t granted = dds::granted_socket_buffer_bytes(wanted_bytes);
  if (granted >= wanted_bytes) return {};
  const dds::Diagnostic diagnostic{
      .severity = dds::Severity::advice,
      .what = "UDP buffers are too small: large clouds over UDP can get lost",
      .evidence = "they have " + std::to_string(granted) + " bytes instead of " +
                  std::to_string(wanted_bytes),
      .hint = "sudo sysctl net.core.rmem_max=" + std::to_string(wanted_bytes)};
  log(diagnostic);
  return {diagnostic};
}

ServerTraits traits(const ServerConfig& config, const Segmenter& labels,
                    const dds::DdsOptions& options) {
  return {.delivery = config.input.delivery,
          .label_source = labels.name(),
          .sensor = config.mapper.sensor.name,
          .points_topic = config.topics.points,
          .host_diagnostics = host_diagnostics(options.socket_buffer_bytes)};
}

std::optional<SavedMap> saved_map(MapSaver& saver, const MapFileConfig& config) {
  if (!config.load_at_start) return std::nullopt;
  auto stored = saver.load();
  if (stored && !stored->view.tiles.empty()) {
    spdlog::info("going on with {}: {} tiles, {} poses", config.file.string(),
                 stored->view.tiles.size(), stored->trajectory.size());
  }
  return stored;
}

}  // namespace

Server::Server(const ServerConfig& config, std::unique_ptr<Segmenter> label_source)
    : topics_(dds::Topics::in(config.topics.name_space)),
      queue_(config.input.queue_length),
      saver_(latest_map_, config.map.file, file_metadata(config, *label_source),
             config.map.memory_limit_mib),
      tiles_(saver_.tile_store(), (std::size_t{config.map.memory_limit_mib} << 20) / 8),
      participant_(server_options(config.dds)),
      poses_(participant_, topics_, config.frames),
      discovery_diagnostics_(participant_, log),
      report_(
          traits(config, *label_source, participant_.options()), latest_map_, statistics_,
          [this] { return discovery_diagnostics_.diagnostics(); },
          [this] { return receiver_->no_input_reason(); }),
      traversability_cache_(traversability_snapshot_, latest_map_, tiles_),
      grid_provider_(config.traversability, config.frames.map, latest_map_,
                     traversability_snapshot_) {
  start_mapping(config, std::move(label_source));
  receiver_ = std::make_unique<ScanReceiver>(participant_, config, queue_, statistics_);
  map_publisher_ = std::make_unique<MapPublisher>(participant_, topics_, config, latest_map_);
  if (occupancy_) {
    octomap_publisher_ =
        std::make_unique<OctomapPublisher>(participant_, topics_, config, *occupancy_);
  }
  start_traversability(config);
  start_services(config);
  autosave_ = std::make_unique<CheckpointThread>(
      std::chrono::duration<double>(config.map.save_period_s), [this] { save_in_background(); });
  start_metrics(config.metrics);
}

Server::~Server() = default;

ThrottleCallback Server::throttle_callback(const ServerConfig& config,
                                           SaturationPolicy saturation_policy) const {
  // Where every scan counts, poses may come later, so that octree and areas keep up.
  if (config.input.delivery == DeliveryMode::every) return {};
  return make_throttle_callback(throttle_, saturation_policy);
}

void Server::stop() {
  throttle_.release();
  // Who asks goes first, then who brings, then who maps: nobody waits for somebody gone.
  metrics_.reset();
  autosave_.reset();
  services_.reset();
  status_publisher_.reset();
  receiver_.reset();
  // They get little time while scans come.
  octomap_publisher_.reset();
  traversability_thread_.reset();
  mapping_->stop();
  saver_.save_at_end();
}

void Server::start_mapping(const ServerConfig& config, std::unique_ptr<Segmenter> label_source) {
  if (config.publish.scan) scans_.emplace(participant_, topics_);
  if (!config.topics.odometry_prior.empty()) {
    prior_.emplace(participant_, config.topics.odometry_prior);
  }
  if (config.occupancy.enabled) {
    // An octree that misses scans is better than late poses.
    occupancy_.emplace(config.occupancy, statistics_,
                       throttle_callback(config, SaturationPolicy::wait));
  }
  const MappingOutputs outputs{.poses = &poses_,
                               .scans = scans_ ? &*scans_ : nullptr,
                               .prior = prior_ ? &*prior_ : nullptr,
                               .occupancy = occupancy_ ? &*occupancy_ : nullptr,
                               .throttle = &throttle_};
  mapping_ = std::make_unique<MappingThread>(config, std::move(label_source),
                                             saved_map(saver_, config.map), saver_.tile_store(),
                                             queue_, statistics_, latest_map_, outputs);
  saver_.set_source({.take = [this](bool everything) { return mapping_->checkpoint(everything); },
                     .stored = [this](std::uint64_t step) { mapping_->checkpoint_stored(step); },
                     .map_bytes = [this] { return mapping_->memory_use().bytes; }});
}

void Server::start_services(const ServerConfig& config) {
  const auto status = [this] { return this->status(); };
  ServiceContext context{
      .latest_map = latest_map_,
      .tiles = tiles_,
      .saver = saver_,
      .status = status,
      .reset = [this] { return mapping_->reset(); },
      .load =
          [this](const SavedMap& stored, const std::shared_ptr<TileStore>& tile_store) {
            mapping_->load(stored, tile_store);
            tiles_.use_tile_store(tile_store);
          },
      .publish_now = [this] { mapping_->publish_now(); },
      .removed = [this](const Eigen::AlignedBox3d& box_map) { return mapping_->removed(box_map); },
      .restore_removed =
          [this](RemovalReason reason, const Eigen::AlignedBox3d& box_map) {
            return mapping_->restore_removed(reason, box_map);
          },
      .query_occupancy = {},
      .encode_octomap = {},
      .traversability = traversability_cache_,
      .grid_provider = grid_provider_,
      .map_frame = config.frames.map,
      .log = service_log_};
  if (occupancy_) {
    context.query_occupancy = [this](const OccupancyQuery& query) {
      return occupancy_->answer(query);
    };
    context.encode_octomap = [this](bool binary) { return occupancy_->encode(binary); };
  }
  services_ =
      std::make_unique<MapServices>(participant_, config.topics.name_space, std::move(context));
  status_publisher_ = std::make_unique<StatusPublisher>(participant_, topics_,
                                                        config.publish.status_period_s, status);
}

dds::ServerStatus Server::status() const {
  dds::ServerStatus status = report_.status();
  for (const auto& [name, value] : participant_.service_faults().counts()) {
    status.counters.push_back({.name = name, .value = value});
  }
  return status;
}

void Server::start_traversability(const ServerConfig& config) {
  std::vector<RobotProfile> robots = load_robots(config.traversability);
  if (robots.empty()) return;
  if (!config.traversability.grid_profile.empty()) {
    traversability_publisher_ =
        std::make_unique<TraversabilityPublisher>(participant_, topics_, grid_provider_);
  }
  const auto publish = [this] {
    if (traversability_publisher_) traversability_publisher_->publish();
  };
  traversability_thread_ = std::make_unique<TraversabilityThread>(
      std::move(robots), std::chrono::duration<double>(config.traversability.update_period_s),
      latest_map_, traversability_snapshot_, statistics_, publish,
      throttle_callback(config, SaturationPolicy::run_at_ten_percent));
}

void Server::start_metrics(const MetricsConfig& config) {
  if (config.address.empty()) return;
  metrics_ = std::make_unique<MetricsEndpoint>(config.address, [this]() -> MetricsSnapshot {
    return {.status = report_.status(),
            .stages = statistics_.stage_statistics(),
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
    save_log_.error("save", std::string("the map was not saved: ") + error.what());
  }
}

}  // namespace stillmap::server
