#pragma once

#include <optional>
#include <string>
#include <utility>

#include "config/loaders/server_config.hpp"
#include "core/map/query/tile_reader.hpp"
#include "server/mapping/map_saver.hpp"
#include "server/publishers/latest_map.hpp"

namespace stillmap::server {

/// The map apart from who maps it: its file, the latest views of it, and its tiles. Knows no DDS,
/// so that a server whose map file is unusable ends before anybody sees it.
class MapStorage {
 public:
  /// Opens the map file, and loads it where the configuration says so; otherwise a map that is in
  /// it is kept under another name. `label_source` goes into the file. Throws MapFileError, also
  /// for a map that does not fit the configuration.
  MapStorage(const ServerConfig& config, const std::string& label_source, Statistics& statistics);

  /// What was loaded, for mapping to resume; nothing where nothing was, and from the second call
  /// on.
  [[nodiscard]] std::optional<SavedMap> take_loaded() {
    return std::exchange(loaded_, std::nullopt);
  }

  [[nodiscard]] LatestMap& latest_map() { return latest_map_; }
  [[nodiscard]] MapSaver& saver() { return saver_; }
  /// Reads tiles from memory or from the map file.
  [[nodiscard]] TileReader& tiles() { return tiles_; }

 private:
  LatestMap latest_map_;
  MapSaver saver_;
  std::optional<SavedMap> loaded_;
  // Of the file as it is once the map was loaded or put aside.
  TileReader tiles_;
};

}  // namespace stillmap::server
