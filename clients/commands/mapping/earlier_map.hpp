#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/localization/place_index.hpp"
#include "core/map/static_map.hpp"
#include "core/map/storage/map_file_copy.hpp"
#include "core/map/storage/map_sessions.hpp"
#include "core/session/map_alignment.hpp"

namespace stillmap::cli {

/// The map that a drive, or another map, is put onto. The file is copied when it is named, and
/// never changed.
class EarlierMap {
 public:
  /// Throws MapFileError for what is no map file, and std::invalid_argument for an empty map, or
  /// one whose voxels or tiles are of other sizes than those given.
  EarlierMap(std::filesystem::path file, const std::optional<StaticMapConfig>& sizes);

  [[nodiscard]] const std::filesystem::path& file() const { return file_; }
  [[nodiscard]] const SavedMap& saved() const { return saved_; }
  [[nodiscard]] const std::shared_ptr<const PlaceIndex>& index() const { return index_; }
  /// What tells it from other maps, in words.
  [[nodiscard]] std::string identity() const;
  /// What must be added to the stamps of a drive that begins with this one, so that times ascend.
  [[nodiscard]] std::int64_t clock_offset_ns(std::int64_t first_stamp_ns) const;
  /// Of the path in `saved`, whatever the file holds by now. Throws MapFileError.
  [[nodiscard]] std::vector<MapSession> sessions() const;
  /// Throws MapFileError.
  void copy_to(const std::filesystem::path& file) const;

 private:
  std::filesystem::path file_;
  MapFileCopy copy_;
  SavedMap saved_;
  std::shared_ptr<const PlaceIndex> index_;
};

/// How a drive was put onto an earlier map.
struct SessionReport {
  /// Scans by their numbers in the data set.
  MapAlignment alignment;
  std::int64_t clock_offset_ns = 0;
  double seconds = 0.0;
};

}  // namespace stillmap::cli
