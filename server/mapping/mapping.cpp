#include "server/mapping/mapping.hpp"

#include <spdlog/spdlog.h>

#include <map>
#include <utility>

namespace stillmap::server {
namespace {

std::map<std::string, std::string> file_metadata(const ServerConfig& config,
                                                 const std::string& label_source) {
  std::map<std::string, std::string> metadata{
      {"software", std::string("stillmap ") + STILLMAP_VERSION},
      {"sensor", config.mapper.sensor.name},
      {"label_source", label_source}};
  if (!config.map.datum.empty()) metadata["datum"] = config.map.datum;
  return metadata;
}

std::size_t tile_cache_bytes(const MapFileConfig& config) {
  return (std::size_t{config.memory_limit_mib} << 20) / 8;
}

std::optional<SavedMap> saved_map(MapSaver& saver, const MapFileConfig& config) {
  if (!config.load_at_start) return std::nullopt;
  auto stored = saver.load();
  if (stored && !stored->view.tiles.empty()) {
    spdlog::info("resuming from {}: {} tiles, {} poses", config.file.string(),
                 stored->view.tiles.size(), stored->trajectory.size());
  }
  return stored;
}

}  // namespace

Mapping::Mapping(const ServerConfig& config, std::unique_ptr<Segmenter> segmenter,
                 const MappingContext& context)
    : label_source_(segmenter->name()),
      scans_(config.input.queue_length),
      saver_(latest_map_, context.statistics, config.map.file, file_metadata(config, label_source_),
             config.map.memory_limit_mib),
      tiles_(saver_.tile_store(), tile_cache_bytes(config.map)),
      poses_(context.participant, context.topics, config.frames) {
  if (config.publish.scan) labelled_scans_.emplace(context.participant, context.topics);
  if (!config.topics.odometry_prior.empty()) {
    prior_.emplace(context.participant, config.topics.odometry_prior);
  }
  const MappingOutputs outputs{.poses = &poses_,
                               .scans = labelled_scans_ ? &*labelled_scans_ : nullptr,
                               .prior = prior_ ? &*prior_ : nullptr,
                               .occupancy = context.occupancy,
                               .throttle = &context.throttle};
  thread_.emplace(config, std::move(segmenter), saved_map(saver_, config.map), saver_.tile_store(),
                  scans_, context.statistics, latest_map_, outputs);
  saver_.set_source(*thread_);
  checkpoints_.emplace(std::chrono::duration<double>(config.map.save_period_s),
                       [this] { saver_.save_if_changed(); });
}

void Mapping::stop() {
  checkpoints_.reset();
  thread_->stop();
  saver_.save_at_end();
}

void Mapping::load(const SavedMap& map, const std::shared_ptr<TileStore>& tile_store) {
  thread_->load(map, tile_store);
  tiles_.use_tile_store(tile_store);
}

}  // namespace stillmap::server
