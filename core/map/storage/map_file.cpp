#include "core/map/storage/map_file.hpp"

#include <SQLiteCpp/Backup.h>
#include <SQLiteCpp/Database.h>
#include <SQLiteCpp/Exception.h>
#include <SQLiteCpp/Statement.h>
#include <SQLiteCpp/Transaction.h>
#include <sqlite3.h>

#include <atomic>
#include <memory>
#include <optional>
#include <system_error>
#include <utility>
#include <vector>

#include "core/map/storage/fresh_map_file.hpp"
#include "core/map/storage/map_database.hpp"
#include "core/map/storage/map_file_watch.hpp"
#include "core/map/storage/map_tables.hpp"
#include "core/map/storage/save_marks.hpp"
#include "core/map/storage/session_tables.hpp"
#include "core/map/storage/sqlite_tile_store.hpp"
#include "core/map/storage/tile_codec.hpp"
#include "core/process/temporary_folder.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

/// The name that links lead to, whether or not a file has it: a file that is made there would
/// otherwise take the link's place.
fs::path end_of_links(const fs::path& file) {
  // As many as Linux follows.
  constexpr int max_links = 40;
  fs::path name = fs::absolute(file);
  std::error_code not_there;
  for (int links = 0; fs::is_symlink(fs::symlink_status(name, not_there)); ++links) {
    if (links == max_links) {
      throw UnusableMapFileError(file,
                                 "is a link that leads to no file, but to another link and "
                                 "so on; name a file");
    }
    const fs::path target = fs::read_symlink(name, not_there);
    if (not_there) return name;
    name = name.parent_path() / target;
  }
  return name;
}

std::shared_ptr<const TemporaryFolder> scratch_folder() {
  const fs::path prefix = fs::temp_directory_path() / "stillmap-";
  try {
    return std::make_shared<const TemporaryFolder>(prefix, TemporaryFolder::OfTheDead::remove);
  } catch (const fs::filesystem_error& error) {
    throw MapFileError(error.path1(), "cannot be made; set TMPDIR to a folder that can be written");
  }
}

class SqliteMapStore : public MapStore {
 public:
  explicit SqliteMapStore(const fs::path& file,
                          std::shared_ptr<const TemporaryFolder> folder = nullptr)
      : folder_(std::move(folder)),
        file_(file),
        database_(open_map_database(file)),
        watch_(file, database_) {
    // Only when it is certain whose file that is.
    database_.exec("PRAGMA wal_autocheckpoint = 0");
  }

  std::uint64_t save(const SavedMap& map) override {
    std::uint64_t log_bytes = 0;
    writing([&] {
      bring_tables_up_to_date();
      read_what_is_saved();
      empty_log_before();
      if (!saved_tiles_) saved_tiles_ = read_tile_infos(database_);
      const bool was_alone = log_is_empty_;
      write_with_session(map, tiles_after(map));
      std::error_code no_log;
      log_bytes = fs::file_size(beside(file_, "-wal"), no_log);
      if (no_log) log_bytes = 0;
      check_content(was_alone);
      // So that a copy of the file alone is a copy of the map.
      empty_log("TRUNCATE");
    });
    return 2 * log_bytes;
  }

  SavedMap load() override {
    return reading([this] {
      SavedMap map{
          read_map_row(database_), {}, read_trajectory(database_), read_metadata(database_)};
      map.view.tiles = TileTable(read_tiles(database_, map.view));
      if (!has_first_schema(database_)) {
        map.tile_evidence = read_tile_evidence(database_, map.view);
      }
      check_consistency(map);
      remember(map);
      return map;
    });
  }

  SavedMap load_non_resident() override {
    writing([this] { bring_tables_up_to_date(); });
    return reading([this] {
      SavedMap map{read_map_row(database_), read_hidden_tile_ids(database_),
                   read_trajectory(database_), read_metadata(database_)};
      map.view.tiles = read_tile_infos(database_);
      remember(map);
      return map;
    });
  }

  std::shared_ptr<TileStore> tile_store() override {
    return std::make_shared<SqliteTileStore>(file_, folder_, is_log_abandoned_);
  }

  void begin_run(std::uint64_t map_id, const RunSession& said) override {
    writing([&] {
      forget_if_changed_by_others();
      empty_log_before();
      const bool was_alone = log_is_empty_;
      std::optional<GrowingSession> session = session_of_run(said);
      SQLite::Transaction transaction(database_, SQLite::TransactionBehavior::IMMEDIATE);
      SQLite::Statement rename(database_, "UPDATE map SET map_id = ?");
      rename.bind(1, static_cast<std::int64_t>(map_id));
      rename.exec();
      SQLite::Statement reopen(database_, "DELETE FROM metadata WHERE key = ?");
      reopen.bind(1, map_ended_key);
      reopen.exec();
      commit(transaction);
      session_ = std::move(session);
      check_content(was_alone);
      empty_log("TRUNCATE");
    });
  }

  bool holds_map() override {
    try {
      const auto has_rows = [&](const char* table) {
        return database_.execAndGet(std::string("SELECT EXISTS (SELECT 1 FROM ") + table + ")")
                   .getInt() != 0;
      };
      return has_rows("tiles") || has_rows("trajectory");
    } catch (const SQLite::Exception& error) {
      throw unreadable(file_, error);
    }
  }

  void complete_file() override {
    writing([&] {
      check_fate();
      empty_log("TRUNCATE");
    });
    if (!log_is_empty_) {
      throw MapFileError(file_, "is being read by another program; try again when it has ended");
    }
  }

  void copy_to(const fs::path& name) override {
    const fs::path file = real_file(name);
    // What is there must be a map, or nothing: another program's file is not overwritten.
    if (fs::exists(file)) static_cast<void>(open_map_database(file));
    try {
      const FreshMapFile fresh(file);
      back_up_to(fresh.path());
      put_in_place(fresh.path(), file);
    } catch (const std::runtime_error& error) {
      throw MapFileWriteError(file, std::string("cannot be written (") + error.what() + ")");
    }
  }

  bool copy_to_new(const fs::path& name) override {
    const fs::path file = real_file(name);
    try {
      const FreshMapFile fresh(file);
      back_up_to(fresh.path());
      return put_in_free_place(fresh.path(), file);
    } catch (const std::runtime_error& error) {
      throw MapFileWriteError(file, std::string("cannot be written (") + error.what() + ")");
    }
  }

  MapFileFate fate() override {
    return is_overwritten_ ? MapFileFate::overwritten : watch_.fate(database_);
  }

  bool is_same_under_name() override { return watch_.is_same_under_name(); }

  std::function<void()> abandon() override {
    *is_log_abandoned_ = true;
    sqlite3_db_config(database_.getHandle(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
    return watch_.log_removal();
  }

 private:
  void bring_tables_up_to_date() {
    if (has_first_schema(database_)) upgrade_schema(database_);
    index_tile_infos(database_);
    log_is_empty_ &= watch_.has_empty_log();
  }

  void back_up_to(const fs::path& fresh) {
    SQLite::Database target(sqlite_name(fresh), SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    const int result = SQLite::Backup(target, database_).executeStep(-1);
    // Busy and locked are no exceptions: nothing is copied then.
    if (result != SQLITE_DONE) throw SQLite::Exception(sqlite3_errstr(result), result);
  }

  /// Nothing where there is no map yet, and where sessions cannot be read: the map can.
  std::optional<GrowingSession> session_of_run(const RunSession& said) {
    if (said.withdrawable == 0 || !holds_map()) return std::nullopt;
    try {
      read_what_is_saved();
      return GrowingSession(database_, *saved_trajectory_, said);
    } catch (const SQLite::Exception&) {
      if (said.is_required) throw;
      return std::nullopt;
    }
  }

  void read_what_is_saved() {
    forget_if_changed_by_others();
    if (!saved_trajectory_) saved_trajectory_ = read_trajectory(database_);
  }

  /// A fault of the session's tables, or no room for its tiles, costs the session and not the map.
  void write_with_session(const SavedMap& map, const TileTable& tiles) {
    try {
      write(map, tiles);
    } catch (const SQLite::Exception&) {
      if (!session_ || session_->is_required()) throw;
      std::optional<GrowingSession> session = std::exchange(session_, std::nullopt);
      try {
        write(map, tiles);
      } catch (...) {
        // It was not the session's fault.
        session_ = std::move(session);
        throw;
      }
    }
  }

  void write(const SavedMap& map, const TileTable& tiles) {
    SQLite::Transaction transaction(database_, SQLite::TransactionBehavior::IMMEDIATE);
    const bool is_another_map = read_map_row(database_).map_id != map.view.map_id;
    // Of another map, the run and its session are none.
    if (is_another_map) session_.reset();
    const bool is_of_session = session_ && (!map.tile_evidence.empty() ||
                                            map.trajectory.size() != saved_trajectory_->size());
    if (is_of_session) session_->keep_before(database_, map);
    write_tiles(database_, *saved_tiles_, tiles, map.tile_evidence);
    write_tile_evidence(database_, map.tile_evidence, is_another_map);
    write_trajectory(database_, map.trajectory,
                     SharedTrajectory::common_poses(*saved_trajectory_, map.trajectory));
    write_metadata(database_, map);
    if (is_of_session) session_->update(database_, map);
    commit(transaction);
    if (is_of_session) session_->committed();
    saved_trajectory_ = map.trajectory;
    saved_tiles_ = tiles;
  }

  void commit(SQLite::Transaction& transaction) {
    add_save_mark(database_, log_is_empty_);
    log_is_empty_ = false;
    transaction.commit();
  }

  /// Throws where the file has another content than this store left: the log is not written into
  /// it. `was_alone`: all that was saved until the watch remembered was in the file.
  void check_content(bool was_alone) {
    is_overwritten_ |= watch_.has_own_name() && !watch_.is_own_content(was_alone);
    refuse_overwritten();
  }
  /// The same when nothing was saved since the watch remembered.
  void check_fate() {
    is_overwritten_ |= watch_.fate(database_) == MapFileFate::overwritten;
    refuse_overwritten();
  }
  void refuse_overwritten() const {
    if (!is_overwritten_ && !watch_.is_others()) return;
    throw SQLite::Exception("another program wrote to the file", SQLITE_CORRUPT);
  }

  /// What earlier saves left in the log.
  void empty_log_before() {
    if (log_is_empty_) return;
    check_fate();
    empty_log("PASSIVE");
    // What has no mark of its own, as an upgrade, is in the file by now.
    watch_.remember(database_);
  }

  /// Brings the log's content into the file, unless somebody reads what it still has without it.
  /// "PASSIVE" does not wait for them, "TRUNCATE" does for a while and leaves no log.
  void empty_log(const std::string& mode) {
    SQLite::Statement checkpoint(database_, "PRAGMA wal_checkpoint(" + mode + ")");
    const auto number = [&](int column) { return checkpoint.getColumn(column).getInt(); };
    // Also where that is interrupted by an error.
    watch_.set_partly_written(true);
    if (!checkpoint.executeStep()) return;
    log_is_empty_ = number(0) == 0 && number(1) == number(2);
    // A reader may keep all of the log out of the file, or all but its begin.
    // Below zero: it did not run, and somebody else's may.
    watch_.set_partly_written(number(1) < 0 || (number(1) != number(2) && number(2) > 0));
  }

  template <typename Action>
  void writing(Action action) {
    struct Remembered {
      ~Remembered() { store.watch_.remember(store.database_); }
      SqliteMapStore& store;
    };
    try {
      const Remembered at_end{*this};
      action();
    } catch (const SQLite::Exception& error) {
      throw MapFileWriteError(file_, std::string("cannot be saved (") + error.what() +
                                         "); the last save is still there");
    } catch (const TileCodecError& error) {
      throw MapFileWriteError(file_, std::string("cannot be saved: ") + error.what());
    }
  }

  template <typename Read>
  SavedMap reading(Read read) {
    try {
      const SQLite::Transaction one_state(database_);
      return read();
    } catch (const std::runtime_error& error) {
      throw unreadable(file_, error);
    }
  }

  /// What the file is to hold.
  [[nodiscard]] TileTable tiles_after(const SavedMap& map) const {
    if (!map.is_partial) return map.view.tiles;
    std::vector<TileTable::Edit> edits;
    for (const auto& [id, evidence] : map.tile_evidence) {
      edits.push_back({id, map.view.tiles.find(id)});
    }
    return saved_tiles_->with(edits);
  }

  /// Another connection may have written to the file.
  void forget_if_changed_by_others() {
    const std::int64_t version = database_.execAndGet("PRAGMA data_version").getInt64();
    if (version == data_version_) return;
    follow_others(version);
    refuse_overwritten();
    saved_trajectory_.reset();
    saved_tiles_.reset();
  }

  void follow_others(std::int64_t version) {
    data_version_ = version;
    log_is_empty_ = false;
    watch_.remember(database_);
  }

  void remember(const SavedMap& stored) {
    const std::int64_t version = database_.execAndGet("PRAGMA data_version").getInt64();
    if (version != data_version_) follow_others(version);
    saved_trajectory_ = stored.trajectory;
    saved_tiles_ = stored.view.tiles;
  }

  std::shared_ptr<const TemporaryFolder> folder_;
  fs::path file_;
  SQLite::Database database_;
  MapFileWatch watch_;
  /// Found while it was saved; the log has what the file does not.
  bool is_overwritten_ = false;
  /// What is stored, once it was read: a save looks at what differs from it.
  std::optional<SharedTrajectory> saved_trajectory_;
  std::optional<TileTable> saved_tiles_;
  /// Of a run that resumed the map.
  std::optional<GrowingSession> session_;
  /// SQLite's, of that time: it changes with what other connections write.
  std::int64_t data_version_ = -1;
  bool log_is_empty_ = false;
  /// For readers of tiles, which may be the last to close.
  std::shared_ptr<std::atomic<bool>> is_log_abandoned_ = std::make_shared<std::atomic<bool>>(false);
};

}  // namespace

SavedMap to_saved_map(const MapCheckpoint& checkpoint) {
  SavedMap map{*checkpoint.view, {}, {}, {}};
  std::vector<TileTable::Edit> current;
  for (const auto& [id, record] : checkpoint.records) {
    map.tile_evidence.emplace(id, record.evidence);
    if (record.tile) current.push_back({id, record.tile});
  }
  map.view.tiles = map.view.tiles.with(current);
  return map;
}

fs::path real_file(const fs::path& file) {
  std::error_code unknown;
  const fs::path target = end_of_links(file);
  const bool is_link = target != fs::absolute(file);
  if (is_link && !fs::exists(target.parent_path(), unknown) && !unknown) {
    throw MapFileError(file, "is a link to " + target.string() +
                                 ", whose folder is not there; is the disk mounted?");
  }
  const fs::path real = fs::weakly_canonical(target, unknown);
  // What cannot be resolved cannot be opened either, and that has better words for it.
  return unknown ? target : real;
}

std::unique_ptr<MapStore> open_map_file(const fs::path& file) {
  return std::make_unique<SqliteMapStore>(real_file(file));
}

void replace_map_file(const fs::path& fresh, const fs::path& file) {
  try {
    put_in_place(fresh, real_file(file));
  } catch (const fs::filesystem_error& error) {
    throw MapFileWriteError(file, std::string("cannot be replaced (") + error.what() + ")");
  }
}

std::shared_ptr<TileStore> open_tile_store(const fs::path& file) {
  return std::make_shared<SqliteTileStore>(real_file(file));
}

std::unique_ptr<MapStore> open_scratch_map() {
  auto folder = scratch_folder();
  const fs::path file = folder->path() / "map.stillmap";
  return std::make_unique<SqliteMapStore>(file, std::move(folder));
}

}  // namespace stillmap
