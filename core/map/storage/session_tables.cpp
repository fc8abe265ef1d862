#include "core/map/storage/session_tables.hpp"

#include <SQLiteCpp/Statement.h>

#include <algorithm>
#include <utility>

#include "core/map/storage/map_tables.hpp"

namespace stillmap {
namespace {

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

/// The map's path from this pose on; without its way.
MapSession session_from(const SharedTrajectory& path, std::size_t first_pose) {
  MapSession session;
  session.number = 1;
  session.first_pose = first_pose;
  session.poses = path.size() - std::min(first_pose, path.size());
  if (session.poses == 0) return session;
  session.first_stamp_ns = path[first_pose].stamp_ns;
  session.last_stamp_ns = path.back().stamp_ns;
  return session;
}

double way_between_m(const SharedTrajectory& path, std::size_t first, std::size_t last) {
  double way = 0.0;
  for (std::size_t i = first + 1; i <= last; ++i)
    way += (path[i].T_map_lidar.translation() - path[i - 1].T_map_lidar.translation()).norm();
  return way;
}

std::size_t steps_back_in(const SharedTrajectory& path, const MapSession& session) {
  std::size_t steps = 0;
  for (std::size_t i = 1; i < session.poses; ++i) {
    const std::size_t pose = session.first_pose + i;
    if (path[pose].stamp_ns < path[pose - 1].stamp_ns) ++steps;
  }
  return steps;
}

/// Whether the path still has the session's poses; what was restored before the first scan has
/// none.
bool is_in(const SharedTrajectory& path, const MapSession& session) {
  if (session.poses == 0) return session.first_pose <= path.size();
  const std::size_t end = session.first_pose + session.poses;
  return end >= session.poses && end <= path.size() &&
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

/// The map's id and version as they were before a session.
struct MapBefore {
  std::uint64_t map_id = 0;
  std::uint64_t version = 0;
};

void write_row(SQLite::Database& database, const MapSession& session,
               const std::optional<MapBefore>& before, std::uint64_t version_after) {
  SQLite::Statement insert(database,
                           "INSERT OR REPLACE INTO sessions (number, source, first_pose, poses, "
                           "way_m, first_stamp_ns, last_stamp_ns, clock_offset_ns, closures, "
                           "map_id_before, version_before, version_after) "
                           "VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)");
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

/// Those up to `last` stay listed, and cannot be withdrawn any more.
void forget_withdrawal(SQLite::Database& database, int last) {
  run_for(database, "DELETE FROM session_metadata WHERE session <= ?", last);
  run_for(database,
          "UPDATE sessions SET map_id_before = NULL, version_before = NULL WHERE number <= ?",
          last);
}

/// Some of the tiles that are kept of them: all at once would keep the first save of a run waiting.
void remove_some_tiles(SQLite::Database& database, int last) {
  constexpr int tiles_a_save = 256;
  run_for(
      database,
      "DELETE FROM session_tiles WHERE rowid IN (SELECT rowid FROM session_tiles WHERE session <= "
      "? LIMIT " +
          std::to_string(tiles_a_save) + ")",
      last);
}

}  // namespace

void run_for(SQLite::Database& database, const std::string& sql, int session) {
  SQLite::Statement statement(database, sql);
  statement.bind(1, session);
  statement.exec();
}

std::vector<MapSession> read_sessions(SQLite::Database& database, const SharedTrajectory& path) {
  if (path.empty()) return {};
  std::vector<MapSession> sessions = read_rows(database);
  std::erase_if(sessions, [&](const MapSession& session) { return !is_in(path, session); });
  if (sessions.empty() || sessions.front().number != 1) {
    const std::size_t count = sessions.empty() ? path.size() : sessions.front().first_pose;
    if (count > 0) {
      MapSession first = session_from(path, 0);
      first.poses = count;
      first.last_stamp_ns = path[count - 1].stamp_ns;
      first.way_m = way_between_m(path, 0, count - 1);
      sessions.insert(sessions.begin(), first);
    }
  }
  for (MapSession& session : sessions) session.steps_back = steps_back_in(path, session);
  return sessions;
}

void write_first_row(SQLite::Database& database, const SharedTrajectory& path,
                     const std::string& source) {
  MapSession session = session_from(path, 0);
  session.source = source;
  session.way_m = way_between_m(path, 0, path.size() - 1);
  database.exec(session_tables);
  write_row(database, session, std::nullopt, read_map_row(database).version);
}

GrowingSession::GrowingSession(SQLite::Database& database, const SharedTrajectory& stored_path,
                               RunSession said)
    : said_(std::move(said)),
      first_pose_(stored_path.size()),
      metadata_before_(read_metadata(database)),
      measured_(first_pose_) {
  // It tells a reader of the file how its last run ended; nothing decides by it.
  metadata_before_.erase(map_ended_key);
  const std::vector<MapSession> earlier = read_sessions(database, stored_path);
  number_ = earlier.empty() ? 1 : earlier.back().number + 1;
  const MapSnapshot before = read_map_row(database);
  map_id_before_ = before.map_id;
  version_before_ = before.version;
}

void GrowingSession::begin(SQLite::Database& database) const {
  database.exec(session_tables);
  // Of another map that was in this file.
  for (const char* rows :
       {"sessions WHERE number", "session_tiles WHERE session", "session_metadata WHERE session"})
    run_for(database, std::string("DELETE FROM ") + rows + " >= ?", number_);
  forget_withdrawal(database, last_forgotten());
  SQLite::Statement insert(database,
                           "INSERT INTO session_metadata (session, key, value) VALUES (?, ?, ?)");
  for (const auto& [key, value] : metadata_before_) {
    insert.bind(1, number_);
    insert.bind(2, key);
    insert.bind(3, value);
    insert.exec();
    insert.reset();
  }
}

int GrowingSession::last_forgotten() const {
  return number_ - static_cast<int>(std::min<std::size_t>(said_.withdrawable, 1'000'000));
}

void GrowingSession::keep_before(SQLite::Database& database, const SavedMap& map) {
  kept_now_.clear();
  if (!is_in_file_) begin(database);
  remove_some_tiles(database, last_forgotten());
  // Also of those that are not there yet.
  SQLite::Statement keep(
      database,
      "INSERT INTO session_tiles (session, x, y, revision, content_hash, encoded, voxel_count, "
      "min_x, min_y, min_z, max_x, max_y, max_z, evidence) SELECT ?1, wanted.x, wanted.y, "
      "t.revision, t.content_hash, "
      "t.encoded, t.voxel_count, t.min_x, t.min_y, t.min_z, t.max_x, t.max_y, t.max_z, m.encoded "
      "FROM (SELECT ?2 AS x, ?3 AS y) AS wanted "
      "LEFT JOIN tiles t ON t.x = wanted.x AND t.y = wanted.y "
      "LEFT JOIN memories m ON m.x = wanted.x AND m.y = wanted.y");
  for (const auto& [id, evidence] : map.tile_evidence) {
    if (kept_.contains(id)) continue;
    keep.bind(1, number_);
    keep.bind(2, id.x);
    keep.bind(3, id.y);
    keep.exec();
    keep.reset();
    kept_now_.insert(id);
  }
}

void GrowingSession::committed() {
  is_in_file_ = true;
  kept_.merge(kept_now_);
}

void GrowingSession::update(SQLite::Database& database, const SavedMap& map) {
  MapSession session = session_from(map.trajectory, first_pose_);
  session.number = number_;
  session.source = said_.source;
  session.clock_offset_ns = said_.clock_offset_ns;
  session.closures = said_.closures;
  session.way_m = way_m(map.trajectory);
  write_row(database, session, MapBefore{map_id_before_, version_before_}, map.view.version);
}

double GrowingSession::way_m(const SharedTrajectory& path) {
  if (path.size() > measured_ + 1) {
    measured_m_ += way_between_m(path, measured_, path.size() - 1);
    measured_ = path.size() - 1;
  }
  return measured_m_;
}

}  // namespace stillmap
