#pragma once

#include <SQLiteCpp/Database.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

namespace stillmap {

// Every save marks the database with a random number. SQLite applies a log ("-wal") that a crash
// left to whatever database file has its name, also to a backup that was copied over the file; by
// the marks, such a log is found out: it does not go on from what the file holds.

/// Adds a mark within the transaction that is open. `log_was_empty`: all earlier saves are in the
/// file itself, so that marks before the last one are no longer needed.
void add_save_mark(SQLite::Database& database, bool log_was_empty);

/// Within the transaction that makes a map, or another one of a copy, which is no later state of
/// its original: a mark alone, without those of the original.
void begin_save_marks(SQLite::Database& database);

/// In the order of the saves; none in a file that was saved before there were marks.
[[nodiscard]] std::vector<std::int64_t> save_marks(SQLite::Database& database);

/// Differs where a database was made anew by what leaves no mark: VACUUM, an older version's tools.
struct DatabaseShape {
  std::int64_t pages = 0;
  std::int64_t schema = 0;
  friend bool operator==(const DatabaseShape&, const DatabaseShape&) = default;
};
[[nodiscard]] DatabaseShape shape_of(SQLite::Database& database);

/// What a file holds of its own, without its log.
struct LastMark {
  /// A map file without errors in what was read of it. False also while a log is being written into
  /// it.
  bool is_readable = false;
  /// Nothing in one that was saved before there were marks.
  std::optional<std::int64_t> mark;
  DatabaseShape shape;
};
/// Throws SQLite::Exception for a fault of the disk, which says nothing of the content.
[[nodiscard]] LastMark last_mark_without_log(const std::filesystem::path& file);

/// Whether the error is one of what the file holds: of reading, writing or memory otherwise.
[[nodiscard]] bool is_of_content(const SQLite::Exception& error);

/// Renames a log that is not this file's, so that the file is opened as it is alone; its name then
/// ends in "-wal.other". Does nothing where a process has the file open. Throws
/// std::filesystem::filesystem_error.
void put_away_other_log(const std::filesystem::path& file);

}  // namespace stillmap
