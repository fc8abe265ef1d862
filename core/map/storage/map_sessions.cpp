#include "core/map/storage/map_sessions.hpp"

#include <SQLiteCpp/Database.h>
#include <SQLiteCpp/Exception.h>
#include <SQLiteCpp/Statement.h>
#include <SQLiteCpp/Transaction.h>

#include <optional>
#include <utility>

#include "core/map/storage/map_database.hpp"
#include "core/map/storage/map_file_copy.hpp"
#include "core/map/storage/map_tables.hpp"
#include "core/map/storage/tile_codec.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

/// Programs that do not know these tables leave them alone.
constexpr const char* session_tables = R"sql(
  CREATE TABLE IF NOT EXISTS sessions (
    number INTEGER PRIMARY KEY, source TEXT NOT NULL,
    first_pose INTEGER NOT NULL, poses INTEGER NOT NULL, way_m REAL NOT NULL,
    first_stamp_ns INTEGER NOT NULL, last_stamp_ns INTEGER NOT NULL,
    clock_offset_ns INTEGER NOT NULL, closures INTEGER NOT NULL,
    map_id_before INTEGER, version_before INTEGER, version_after INTEGER);
  CREATE TABLE IF NOT EXISTS session_tiles (
    session INTEGER NOT NULL, x INTEGER NOT NULL, y INTEGER NOT NULL,
    revision INTEGER, content_hash INTEGER, encoded BLOB, voxel_count INTEGER,
    min_x REAL, min_y REAL, min_z REAL, max_x REAL, max_y REAL, max_z REAL,
    evidence BLOB, PRIMARY KEY (session, x, y));
  CREATE TABLE IF NOT EXISTS session_metadata (
    session INTEGER NOT NULL, key TEXT NOT NULL, value TEXT NOT NULL, PRIMARY KEY (session, key));
)sql";

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

double way_m(const SharedTrajectory& path, std::size_t first, std::size_t count) {
  double way = 0.0;
  for (std::size_t i = first + 1; i < first + count; ++i)
    way += (path[i].T_map_lidar.translation() - path[i - 1].T_map_lidar.translation()).norm();
  return way;
}

MapSession session_of(const SharedTrajectory& path, std::size_t first, std::size_t count) {
  MapSession session;
  session.number = 1;
  session.first_pose = first;
  session.poses = count;
  session.way_m = way_m(path, first, count);
  session.first_stamp_ns = path[first].stamp_ns;
  session.last_stamp_ns = path[first + count - 1].stamp_ns;
  return session;
}

/// Whether the path still has the session's poses.
bool is_in(const SharedTrajectory& path, const MapSession& session) {
  const std::size_t end = session.first_pose + session.poses;
  return session.poses > 0 && end <= path.size() &&
         path[session.first_pose].stamp_ns == session.first_stamp_ns &&
         path[end - 1].stamp_ns == session.last_stamp_ns;
}

std::vector<MapSession> read_rows(SQLite::Database& database) {
  std::vector<MapSession> sessions;
  if (!database.tableExists("sessions")) return sessions;
  SQLite::Statement row(database,
                        "SELECT number, source, first_pose, poses, way_m, first_stamp_ns, "
                        "last_stamp_ns, clock_offset_ns, closures FROM sessions ORDER BY number");
  const auto count = [&row](int column) {
    return static_cast<std::size_t>(std::max<std::int64_t>(row.getColumn(column).getInt64(), 0));
  };
  while (row.executeStep()) {
    sessions.push_back({.number = row.getColumn(0).getInt(),
                        .source = row.getColumn(1).getString(),
                        .first_pose = count(2),
                        .poses = count(3),
                        .way_m = row.getColumn(4).getDouble(),
                        .first_stamp_ns = row.getColumn(5).getInt64(),
                        .last_stamp_ns = row.getColumn(6).getInt64(),
                        .clock_offset_ns = row.getColumn(7).getInt64(),
                        .closures = count(8)});
  }
  return sessions;
}

/// Those that the path has; the first one whether the file knows it or not. A server may have begun
/// another map in the file, or gone on in it.
std::vector<MapSession> read_sessions(SQLite::Database& database) {
  const SharedTrajectory path = read_trajectory(database);
  if (path.empty()) return {};
  std::vector<MapSession> sessions = read_rows(database);
  std::erase_if(sessions, [&](const MapSession& session) { return !is_in(path, session); });
  if (sessions.empty() || sessions.front().number != 1) {
    const std::size_t count = sessions.empty() ? path.size() : sessions.front().first_pose;
    if (count > 0) sessions.insert(sessions.begin(), session_of(path, 0, count));
  }
  return sessions;
}

void write_row(SQLite::Database& database, const MapSession& session,
               const std::optional<MapSnapshot>& before, std::uint64_t version_after) {
  SQLite::Statement insert(database,
                           "INSERT OR REPLACE INTO sessions VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, "
                           "?, ?)");
  insert.bind(1, session.number);
  insert.bind(2, session.source);
  insert.bind(3, static_cast<std::int64_t>(session.first_pose));
  insert.bind(4, static_cast<std::int64_t>(session.poses));
  insert.bind(5, session.way_m);
  insert.bind(6, session.first_stamp_ns);
  insert.bind(7, session.last_stamp_ns);
  insert.bind(8, session.clock_offset_ns);
  insert.bind(9, static_cast<std::int64_t>(session.closures));
  if (before) {
    insert.bind(10, static_cast<std::int64_t>(before->map_id));
    insert.bind(11, static_cast<std::int64_t>(before->version));
  }
  insert.bind(12, static_cast<std::int64_t>(version_after));
  insert.exec();
}

/// Copies of these tiles as they are now, also of those that are not there yet.
void keep_tiles(SQLite::Database& database, int session, const TileEvidenceMap& changed) {
  SQLite::Statement keep(
      database,
      "INSERT OR REPLACE INTO session_tiles SELECT ?1, wanted.x, wanted.y, t.revision, "
      "t.content_hash, t.encoded, t.voxel_count, t.min_x, t.min_y, t.min_z, t.max_x, t.max_y, "
      "t.max_z, m.encoded FROM (SELECT ?2 AS x, ?3 AS y) AS wanted "
      "LEFT JOIN tiles t ON t.x = wanted.x AND t.y = wanted.y "
      "LEFT JOIN memories m ON m.x = wanted.x AND m.y = wanted.y");
  for (const auto& [id, evidence] : changed) {
    keep.bind(1, session);
    keep.bind(2, id.x);
    keep.bind(3, id.y);
    keep.exec();
    keep.reset();
  }
}

void run(SQLite::Database& database, const std::string& sql, int session) {
  SQLite::Statement statement(database, sql);
  statement.bind(1, session);
  statement.exec();
}

void restore_tiles(SQLite::Database& database, int session) {
  for (const char* table : {"tiles", "memories"}) {
    run(database,
        std::string("DELETE FROM ") + table +
            " WHERE (x, y) IN (SELECT x, y FROM session_tiles WHERE session = ?)",
        session);
  }
  run(database,
      "INSERT INTO tiles SELECT x, y, revision, content_hash, encoded, voxel_count, min_x, min_y, "
      "min_z, max_x, max_y, max_z FROM session_tiles WHERE session = ? AND encoded IS NOT NULL",
      session);
  run(database,
      "INSERT INTO memories SELECT x, y, evidence FROM session_tiles WHERE session = ? AND "
      "evidence IS NOT NULL",
      session);
}

void restore_map_row(SQLite::Database& database, const MapSession& session) {
  run(database,
      "UPDATE map SET (map_id, version) = (SELECT map_id_before, version_before FROM sessions "
      "WHERE number = ?)",
      session.number);
  database.exec("DELETE FROM metadata");
  run(database, "INSERT INTO metadata SELECT key, value FROM session_metadata WHERE session = ?",
      session.number);
  SQLite::Statement shorten(database, "DELETE FROM trajectory WHERE position >= ?");
  shorten.bind(1, static_cast<std::int64_t>(session.first_pose));
  shorten.exec();
}

std::uint64_t version_after(SQLite::Database& database, int session) {
  SQLite::Statement row(database, "SELECT version_after FROM sessions WHERE number = ?");
  row.bind(1, session);
  return row.executeStep() ? static_cast<std::uint64_t>(row.getColumn(0).getInt64()) : 0;
}

/// Throws MapFileError where there is none.
MapSession withdrawable_session(SQLite::Database& database, const fs::path& file) {
  const std::vector<MapSession> sessions = read_sessions(database);
  if (sessions.size() < 2)
    throw MapFileError(file, "has one session alone: without it, nothing would be left of the map");
  const MapSession& newest = sessions.back();
  if (newest.first_pose + newest.poses == read_trajectory(database).size() &&
      version_after(database, newest.number) == read_map_row(database).version)
    return newest;
  throw MapFileError(file, "was mapped on in by a server since session " +
                               std::to_string(newest.number) +
                               ", which built on it: it cannot be withdrawn any more; name a copy "
                               "of before");
}

}  // namespace

std::vector<MapSession> read_map_sessions(const fs::path& file) {
  const MapFileCopy copy(file);
  copy.check_format();
  return with_errors_of(file, [&] {
    SQLite::Database database = connect_to_map_database(copy.path());
    return read_sessions(database);
  });
}

void write_first_session(const fs::path& file, const std::string& source) {
  with_errors_of(file, [&] {
    SQLite::Database database = open_map_database(file);
    const SharedTrajectory path = read_trajectory(database);
    if (path.empty()) return;
    MapSession session = session_of(path, 0, path.size());
    session.source = source;
    SQLite::Transaction transaction(database);
    database.exec(session_tables);
    write_row(database, session, std::nullopt, read_map_row(database).version);
    transaction.commit();
  });
}

void add_map_session(const fs::path& file, const SavedMap& after, const MapSession& said) {
  with_errors_of(file, [&] {
    SQLite::Database database = open_map_database(file);
    if (has_first_schema(database)) upgrade_schema(database);
    const std::vector<MapSession> earlier = read_sessions(database);
    const std::size_t first_pose = read_trajectory(database).size();
    MapSession session =
        session_of(after.trajectory, first_pose, after.trajectory.size() - first_pose);
    session.number = earlier.empty() ? 1 : earlier.back().number + 1;
    session.source = said.source;
    session.clock_offset_ns = said.clock_offset_ns;
    session.closures = said.closures;
    SQLite::Transaction transaction(database);
    database.exec(session_tables);
    // Of another map that was in this file.
    for (const char* rows :
         {"sessions WHERE number", "session_tiles WHERE session", "session_metadata WHERE session"})
      run(database, std::string("DELETE FROM ") + rows + " >= ?", session.number);
    keep_tiles(database, session.number, after.tile_evidence);
    run(database, "INSERT INTO session_metadata SELECT ?, key, value FROM metadata",
        session.number);
    write_row(database, session, read_map_row(database), after.view.version);
    transaction.commit();
  });
  const std::unique_ptr<MapStore> store = open_map_file(file);
  // Another map to clients, but with the evidence of the tiles that stay.
  store->begin_run(after.view.map_id);
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
      run(database, std::string("DELETE FROM ") + rows + " = ?", newest.number);
    transaction.commit();
    database.exec("VACUUM");
  });
  open_map_file(copy.path())->copy_to(out);
}

}  // namespace stillmap
