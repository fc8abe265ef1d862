#pragma once

#include <filesystem>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>

#include "core/map/tile.hpp"
#include "core/odometry/trajectory.hpp"

namespace stillmap {

/// A map file that cannot be opened, read or written. The text names the file, the fault and the
/// way out.
class MapFileError : public std::runtime_error {
 public:
  MapFileError(const std::filesystem::path& file, const std::string& fault)
      : std::runtime_error(file.string() + ": " + fault) {}
};

/// What a map file holds. Of the map that is the planning view: what was seen too rarely, or as a
/// movable class, starts anew after a restart.
struct StoredMap {
  MapView view;
  Trajectory trajectory;
  /// Free key-value pairs: "sensor", "label_source", "software".
  std::map<std::string, std::string> metadata;
};

/// Where tiles are kept between runs. The narrow waist behind which SQLite may one day be another
/// database.
class TileStore {
 public:
  virtual ~TileStore() = default;
  /// Brings the store to this state in one transaction: after a crash the store holds either the
  /// last save or this one. Tiles that did not change are not written again.
  virtual void save(const StoredMap& map) = 0;
  /// The last saved state; an empty map when nothing was saved yet.
  [[nodiscard]] virtual StoredMap load() = 0;
};

/// Opens or makes an SQLite map file (WAL; the file alone is complete after each save and may be
/// copied). Throws MapFileError: no database, another program's, written by a newer version,
/// damaged, or in a folder that cannot be written. Such a file is left untouched.
[[nodiscard]] std::unique_ptr<TileStore> open_map_file(const std::filesystem::path& file);

}  // namespace stillmap
