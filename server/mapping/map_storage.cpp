#include "server/mapping/map_storage.hpp"

#include <spdlog/spdlog.h>

#include <map>
#include <stdexcept>

#include "core/map/storage/fresh_map_file.hpp"

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

/// A running map that was being written beside its name may be whole nowhere else.
void tell_of_unfinished_files(const std::filesystem::path& map_file) {
  if (map_file.empty()) return;
  for (const auto& file : fresh_files_beside(map_file)) {
    spdlog::warn(
        "{} is a map that a server was writing beside {} when it was killed, unless one writes it "
        "now: 'stillmap map-check' tells whether it is whole; move it to a name, or remove its "
        "folder",
        file.string(), map_file.string());
  }
}

std::optional<SavedMap> saved_map(MapSaver& saver, const ServerConfig& config) {
  tell_of_unfinished_files(config.map.file);
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
