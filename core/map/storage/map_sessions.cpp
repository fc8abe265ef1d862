#include "core/map/storage/map_sessions.hpp"

#include <SQLiteCpp/Database.h>
#include <SQLiteCpp/Exception.h>
#include <SQLiteCpp/Statement.h>
#include <SQLiteCpp/Transaction.h>

#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/map/storage/fresh_map_file.hpp"
#include "core/map/storage/map_database.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/map/storage/map_file_copy.hpp"
#include "core/map/storage/map_tables.hpp"
#include "core/map/storage/save_marks.hpp"
#include "core/map/storage/session_tables.hpp"
#include "core/map/storage/tile_codec.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

template <typename Action>
auto with_errors_of(const fs::path& file, Action action) {
  try {
    return action();
  } catch (const SQLite::Exception& error) {
    throw MapFileError(file, std::string("its sessions cannot be read or written (") +
                                 error.what() + "); restore a copy or name another file");
  } catch (const TileCodecError& error) {
    throw MapFileError(file, std::string("cannot be read (") + error.what() + ")");
  }
}

void restore_tiles(SQLite::Database& database, int session) {
  for (const char* table : {"tiles", "memories"}) {
    run_for(database,
            std::string("DELETE FROM ") + table +
                " WHERE (x, y) IN (SELECT x, y FROM session_tiles WHERE session = ?)",
            session);
  }
  run_for(
      database,
      "INSERT INTO tiles SELECT x, y, revision, content_hash, encoded, voxel_count, min_x, min_y, "
      "min_z, max_x, max_y, max_z FROM session_tiles WHERE session = ? AND encoded IS NOT NULL",
      session);
  run_for(database,
          "INSERT INTO memories SELECT x, y, evidence FROM session_tiles WHERE session = ? AND "
          "evidence IS NOT NULL",
          session);
}

void restore_map_row(SQLite::Database& database, const MapSession& session) {
  run_for(database,
          "UPDATE map SET (map_id, version) = (SELECT map_id_before, version_before FROM sessions "
          "WHERE number = ?)",
          session.number);
  database.exec("DELETE FROM metadata");
  run_for(database,
          "INSERT INTO metadata SELECT key, value FROM session_metadata WHERE session = ?",
          session.number);
  SQLite::Statement shorten(database, "DELETE FROM trajectory WHERE position >= ?");
  shorten.bind(1, static_cast<std::int64_t>(session.first_pose));
  shorten.exec();
}

/// Whether the file keeps what was before a session, and the map's version at its end.
struct SessionEnds {
  bool has_before = false;
  std::uint64_t version_after = 0;
};
SessionEnds ends_of(SQLite::Database& database, int session) {
  SQLite::Statement row(database,
                        "SELECT version_before IS NOT NULL, version_after FROM sessions WHERE "
                        "number = ?");
  row.bind(1, session);
  if (!row.executeStep()) return {};
  return {row.getColumn(0).getInt() != 0, static_cast<std::uint64_t>(row.getColumn(1).getInt64())};
}

/// Whether there is anything in the map without the session.
bool leaves_tiles(SQLite::Database& database, int session) {
  SQLite::Statement kept(
      database,
      "SELECT EXISTS (SELECT 1 FROM session_tiles WHERE session = ?1 AND "
      "(encoded IS NOT NULL OR evidence IS NOT NULL)) OR EXISTS (SELECT 1 FROM "
      "tiles WHERE (x, y) NOT IN (SELECT x, y FROM session_tiles WHERE session = "
      "?1))");
  kept.bind(1, session);
  return kept.executeStep() && kept.getColumn(0).getInt() != 0;
}

/// Throws MapFileError where there is none.
MapSession withdrawable_session(SQLite::Database& database, const fs::path& file) {
  const SharedTrajectory path = read_trajectory(database);
  const std::vector<MapSession> sessions = read_sessions(database, path);
  const auto throw_alone = [&file] {
    throw MapFileError(file, "has one session alone: without it, nothing would be left of the map");
  };
  if (sessions.empty()) throw_alone();
  const MapSession& newest = sessions.back();
  const std::string name = "session " + std::to_string(newest.number);
  const SessionEnds ends =
      database.tableExists("sessions") ? ends_of(database, newest.number) : SessionEnds{};
  // A map may have tiles from before its first session where it had no path.
  if (sessions.size() == 1 && !(ends.has_before && leaves_tiles(database, newest.number)))
    throw_alone();
  if (newest.first_pose + newest.poses != path.size() ||
      ends.version_after != read_map_row(database).version)
    throw MapFileError(file, "was mapped on in since " + name +
                                 " by what keeps no sessions (an older version, a server with "
                                 "map.withdrawable_sessions: 0, or one that found no room for "
                                 "copies of tiles) and built on it: it cannot be withdrawn any "
                                 "more; name a copy of before");
  if (!ends.has_before)
    throw MapFileError(file, "does not keep any more how its tiles were before " + name +
                                 ": as many of the newest sessions as map.withdrawable_sessions of "
                                 "the server's configuration says can be withdrawn; name a copy of "
                                 "before");
  return newest;
}

/// The copy becomes `out`, where a map or nothing is. What a process that is killed meanwhile
/// leaves beside it is of no use: the map that was copied stays.
void put_in_place_of(const fs::path& out, const MapFileCopy& copy) {
  // Another program's file is not overwritten.
  if (const fs::path file = real_file(out); fs::exists(file))
    static_cast<void>(open_map_database(file));
  try {
    const FreshMapFile fresh(out, FreshMapFile::Writing::in_steps);
    open_map_file(copy.path())->copy_to(fresh.path());
    replace_map_file(fresh.path(), out);
  } catch (const std::runtime_error& error) {
    throw MapFileWriteError(out, std::string("cannot be written (") + error.what() + ")");
  }
}

}  // namespace

std::vector<MapSession> read_map_sessions(const fs::path& file) {
  const MapFileCopy copy(file);
  copy.check_format();
  return with_errors_of(file, [&] {
    SQLite::Database database = connect_to_map_database(copy.path());
    return read_sessions(database, read_trajectory(database));
  });
}

void write_first_session(const fs::path& file, const std::string& source) {
  with_errors_of(file, [&] {
    SQLite::Database database = open_map_database(file);
    const SharedTrajectory path = read_trajectory(database);
    if (path.empty()) return;
    SQLite::Transaction transaction(database);
    write_first_row(database, path, source);
    add_save_mark(database, false);
    transaction.commit();
  });
}

void add_map_session(const fs::path& file, const SavedMap& after, const MapSession& said) {
  const std::unique_ptr<MapStore> store = open_map_file(file);
  // Another map to clients, but with the evidence of the tiles that stay.
  store->begin_run(after.view.map_id, {.source = said.source,
                                       .clock_offset_ns = said.clock_offset_ns,
                                       .closures = said.closures,
                                       .withdrawable = std::numeric_limits<std::size_t>::max(),
                                       .is_required = true});
  store->save(after);
}

void withdraw_newest_session(const fs::path& file, const fs::path& out) {
  const MapFileCopy copy(file);
  copy.check_format();
  with_errors_of(file, [&] {
    SQLite::Database database = connect_to_map_database(copy.path());
    const MapSession newest = withdrawable_session(database, file);
    SQLite::Transaction transaction(database);
    restore_tiles(database, newest.number);
    restore_map_row(database, newest);
    for (const char* rows :
         {"session_tiles WHERE session", "session_metadata WHERE session", "sessions WHERE number"})
      run_for(database, std::string("DELETE FROM ") + rows + " = ?", newest.number);
    begin_save_marks(database);
    transaction.commit();
    database.exec("VACUUM");
  });
  put_in_place_of(out, copy);
}

}  // namespace stillmap
