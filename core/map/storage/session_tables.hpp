#pragma once

#include <SQLiteCpp/Database.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "core/map/storage/map_file.hpp"
#include "core/map/storage/map_sessions.hpp"

namespace stillmap {

// Sessions in the tables of a map file. All throw SQLite::Exception.

/// Those that the path of the file has; the first one whether the file knows it or not. A server
/// may have begun another map in the file, or gone on in it.
[[nodiscard]] std::vector<MapSession> read_sessions(SQLite::Database& database,
                                                    const SharedTrajectory& path);

/// Runs a statement with the number of a session for its only parameter.
void run_for(SQLite::Database& database, const std::string& sql, int session);

/// Writes the first session of a map, which is all of its path.
void write_first_row(SQLite::Database& database, const SharedTrajectory& path,
                     const std::string& source);

/// The session that a run is, kept up with each of its saves.
class GrowingSession {
 public:
  /// Of a run that begins with what the database holds, whose path this is.
  GrowingSession(SQLite::Database& database, const SharedTrajectory& stored_path, RunSession said);

  /// In the transaction of a save that changes something, before it: keeps the tiles that it gives
  /// evidence of as they are.
  void keep_before(SQLite::Database& database, const SavedMap& map);
  /// In the same transaction, after it: the session as it is now.
  void update(SQLite::Database& database, const SavedMap& map);
  /// The transaction is in the file.
  void committed();
  /// A save without it is none.
  [[nodiscard]] bool is_required() const { return said_.is_required; }

 private:
  /// The newest session that cannot be withdrawn any more.
  [[nodiscard]] int last_forgotten() const;
  void begin(SQLite::Database& database) const;
  /// Of the map's path from the session's first pose on.
  [[nodiscard]] double way_m(const SharedTrajectory& path);

  RunSession said_;
  int number_ = 0;
  std::size_t first_pose_ = 0;
  /// What the file was: it gets these back when the session is withdrawn.
  std::uint64_t map_id_before_ = 0;
  std::uint64_t version_before_ = 0;
  std::map<std::string, std::string> metadata_before_;
  bool is_in_file_ = false;
  /// Tiles that are kept, and those that are when the transaction is in the file.
  std::set<TileId> kept_;
  std::set<TileId> kept_now_;
  /// The way up to this pose.
  std::size_t measured_ = 0;
  double measured_m_ = 0.0;
};

}  // namespace stillmap
