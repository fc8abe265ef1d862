#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>

#include "core/lidar/shared_trajectory.hpp"
#include "core/map/static_map.hpp"
#include "core/map/tile.hpp"
#include "core/map/tile_evidence.hpp"
#include "core/process/folder_of_file.hpp"

namespace stillmap {

/// A map file that cannot be opened, read or written. The text names the file, the fault and the
/// remedy.
class MapFileError : public std::runtime_error {
 public:
  MapFileError(const std::filesystem::path& file, const std::string& fault)
      : std::runtime_error(file.string() + ": " + fault) {}
};

/// One that stays unusable however often it is tried: no map, of a newer version, damaged.
class UnusableMapFileError : public MapFileError {
 public:
  using MapFileError::MapFileError;
};

/// One that cannot be written: the disk may be full.
class MapFileWriteError : public MapFileError {
 public:
  MapFileWriteError(const std::filesystem::path& file, const std::string& fault)
      : MapFileError(file, fault), had_folder_(is_folder_there(file)) {}
  /// Whether its folder was there: where not, the name is wrong. It may be gone by now, as that of
  /// a run that failed.
  [[nodiscard]] bool had_folder() const { return had_folder_; }

 private:
  bool had_folder_;
};

/// Metadata key of a map that was saved at the end of its run: nothing that was mapped is missing.
inline constexpr const char* map_ended_key = "ended";

/// What a map file holds.
struct SavedMap {
  MapSnapshot view;
  /// Empty for files of Stillmap's first format: what was seen too rarely, or as a movable class,
  /// starts anew.
  TileEvidenceMap tile_evidence;
  SharedTrajectory trajectory;
  /// Free key-value pairs: "sensor", "label_source", "software".
  std::map<std::string, std::string> metadata;
  /// To be saved are the tiles with evidence given alone; the others stay as they are stored.
  bool is_partial = false;
};

/// How a run that goes on in a stored map is remembered in its file (MapSession).
struct RunSession {
  /// Who maps, or what.
  std::string source;
  std::int64_t clock_offset_ns = 0;
  std::size_t closures = 0;
  /// The file keeps the tiles that so many of its newest sessions changed, this one included, as
  /// they were, so that they can be withdrawn. 0: the run is no session of its own.
  std::size_t withdrawable = 0;
  /// Where the session cannot be kept, nothing is saved; else the map is, without it.
  bool is_required = false;
};

/// A checkpoint as it is stored.
[[nodiscard]] SavedMap to_saved_map(const MapCheckpoint& checkpoint);

/// What became of an open map file's name and content, by the hand of somebody who took no lock.
enum class MapFileFate : std::uint8_t {
  kept,
  /// No file has the name; the content is still there while the store is.
  removed,
  /// Another file has the name; as above.
  replaced,
  /// The file has another content, or one that cannot be read: it must not be written to.
  overwritten
};

/// Storage of maps between runs. Hides the database.
class MapStore {
 public:
  virtual ~MapStore() = default;
  /// Brings the store to this state in one transaction: after a crash the store holds either the
  /// last save or this one. Costs what changed since the last save: tiles that did not change are
  /// neither looked at nor written again. Tiles that are
  /// non-resident (`is_non_resident`) stay as they are stored. A tile that is written without
  /// its evidence loses the one that was stored.
  /// Returns about how many bytes were written to the disk, those to the log included.
  virtual std::uint64_t save(const SavedMap& map) = 0;
  /// The last saved state; an empty map when nothing was saved yet.
  [[nodiscard]] virtual SavedMap load() = 0;
  /// The same with all tiles non-resident: neither time nor size depends on their voxels. Of the
  /// tiles with evidence, only those that show nothing are named.
  [[nodiscard]] virtual SavedMap load_non_resident() = 0;
  /// Reads single tiles; may be used beside the store, and after it.
  [[nodiscard]] virtual std::shared_ptr<TileStore> tile_store() = 0;
  /// Mapping resumes from the stored map: sets its id and removes the mark of an ended run, in one
  /// transaction. The saves that follow are this session of the map.
  virtual void begin_run(std::uint64_t map_id, const RunSession& session) = 0;
  /// Whether a save or a run left any tile or pose in it.
  [[nodiscard]] virtual bool holds_map() = 0;
  /// All that was saved is in the file itself, none of it in its log: then the file may be renamed
  /// when the store is gone. Throws MapFileError where another program is reading it.
  virtual void complete_file() = 0;
  /// Writes the last saved state to another file, which is replaced in one step. Throws
  /// MapFileError, and leaves that file as it was.
  virtual void copy_to(const std::filesystem::path& file) = 0;
  /// The same to a name that no file has; false where one has it by then.
  [[nodiscard]] virtual bool copy_to_new(const std::filesystem::path& file) = 0;
  /// Costs some reads of single pages. Throws MapFileError where the file cannot be looked at.
  [[nodiscard]] virtual MapFileFate fate() = 0;
  /// Of one that was replaced: whether the file that has the name is a copy of its last state, or
  /// itself, on a file system whose inode numbers change.
  [[nodiscard]] virtual bool is_same_under_name() = 0;
  /// Before the store goes: what is in its log stays out of the file, which is somebody else's by
  /// now. Returns what removes the log's files when no connection of this process has them open any
  /// more, unless they are others by then.
  [[nodiscard]] virtual std::function<void()> abandon() = 0;
};

/// The file itself, absolute, where a name is a link, also to one that is not there yet: its log
/// and its lock lie beside that. Throws MapFileError for a link that leads to no file in a folder.
[[nodiscard]] std::filesystem::path real_file(const std::filesystem::path& file);

/// Opens or makes an SQLite map file (WAL; the file alone is complete after each save and may be
/// copied). Throws MapFileError: no database, another program's, written by a newer version,
/// damaged, or in a folder that cannot be written. Such a file is left untouched.
[[nodiscard]] std::unique_ptr<MapStore> open_map_file(const std::filesystem::path& file);

/// Puts a map file that no store has open in the place of another one, or of none, in one step.
/// Throws MapFileError.
void replace_map_file(const std::filesystem::path& fresh, const std::filesystem::path& file);

/// The tiles in a map file, read through a connection of their own. Throws MapFileError.
[[nodiscard]] std::shared_ptr<TileStore> open_tile_store(const std::filesystem::path& file);

/// Whether the file's header is that of a map file.
[[nodiscard]] bool is_map_file(const std::filesystem::path& file);

/// A temporary store, removed with its last user, for a map that is not kept but does not fit into
/// memory. Throws MapFileError when the folder for temporary files cannot be written.
[[nodiscard]] std::unique_ptr<MapStore> open_scratch_map();

}  // namespace stillmap
