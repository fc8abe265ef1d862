#include "server/mapping/map_storage.hpp"

#include <spdlog/spdlog.h>

#include <map>
#include <stdexcept>

namespace stillmap::server {
namespace {

std::map<std::string, std::string> file_metadata(const ServerConfig& config,
                                                 const std::string& label_source) {
  std::map<std::string, std::string> metadata{
      {"software", std::string("stillmap ") + STILLMAP_VERSION}, {"label_source", label_source}};
  if (!config.map.datum.empty()) metadata["datum"] = config.map.datum;
  return metadata;
}

std::size_t tile_cache_bytes(const MapFileConfig& config) {
  return (std::size_t{config.memory_limit_mib} << 20) / 8;
}

std::optional<SavedMap> saved_map(MapSaver& saver, const ServerConfig& config) {
  if (!config.map.load_at_start) {
    if (const auto kept = saver.set_saved_map_aside()) {
      spdlog::info("the map in {} is kept as {} (map.load_at_start is false)",
                   config.map.file.string(), kept->string());
    }
    return std::nullopt;
  }
  auto stored = saver.load([&](const MapSnapshot& map) {
    try {
      check_sizes(map, config.mapper.static_map);
    } catch (const std::invalid_argument& fault) {
      throw UnusableMapFileError(config.map.file, fault.what());
    }
  });
  if (stored && !stored->view.tiles.empty()) {
    spdlog::info("resuming from {}: {} tiles, {} poses", config.map.file.string(),
                 stored->view.tiles.size(), stored->trajectory.size());
  }
  return stored;
}

}  // namespace

MapStorage::MapStorage(const ServerConfig& config, const std::string& label_source,
                       Statistics& statistics)
    : saver_(latest_map_, statistics, config.map.file, file_metadata(config, label_source),
             {.memory_limit_mib = config.map.memory_limit_mib,
              .standing_mib_per_hour = config.map.standing_mib_per_hour,
              .saved_maps = {.max_maps = config.map.saved_maps,
                             .max_bytes = std::uintmax_t{config.map.saved_maps_mib} << 20},
              .session = {.source = "server " + config.topics.name_space,
                          .withdrawable = config.map.withdrawable_sessions}}),
      loaded_(saved_map(saver_, config)),
      tiles_(saver_.tile_store(), tile_cache_bytes(config.map)) {}

}  // namespace stillmap::server
