#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "core/map/storage/map_file.hpp"

namespace stillmap {

/// One drive, or one map, that a map is made of.
struct MapSession {
  /// From 1.
  int number = 0;
  /// What was mapped, or the server that did; empty where the file does not say.
  std::string source;
  /// Its poses in the map's path.
  std::size_t first_pose = 0;
  std::size_t poses = 0;
  double way_m = 0.0;
  /// As the path has them.
  std::int64_t first_stamp_ns = 0;
  std::int64_t last_stamp_ns = 0;
  /// What the map's stamps are later than those of the source, whose clock began before the map
  /// ended: times in a map ascend.
  std::int64_t clock_offset_ns = 0;
  /// Places that put it on the map as it was before; 0 for the first session.
  std::size_t closures = 0;
  /// How often a pose has an earlier stamp than the one before it.
  std::size_t steps_back = 0;
};

/// The sessions of a map in their order; one of a map that was made in one run, none of an empty
/// one. The file stays as it is. Throws MapFileError.
[[nodiscard]] std::vector<MapSession> read_map_sessions(const std::filesystem::path& file);

/// Says what the map of this file, which was made in one run, is of. Throws MapFileError.
void write_first_session(const std::filesystem::path& file, const std::string& source);

/// Saves another session into a map file: `after` is partial, with the tiles that it changed, the
/// path of all sessions, and an id of its own. The tiles are kept as they were, so that the session
/// can be withdrawn; other tiles are not touched. Of `session` what the path does not say is taken:
/// source, clock offset, closures. Throws MapFileError; the file then has the map of before under
/// the new id, or the session whole.
void add_map_session(const std::filesystem::path& file, const SavedMap& after,
                     const MapSession& session);

/// Writes the map as it was before its newest session, to the byte in every tile, to another file,
/// which is replaced in one step. `file` stays as it is. Throws MapFileError where there is only
/// one session, where the file does not keep the tiles of before any more, or the map was changed
/// since by something else.
void withdraw_newest_session(const std::filesystem::path& file, const std::filesystem::path& out);

}  // namespace stillmap
