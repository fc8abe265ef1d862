#pragma once

#include <SQLiteCpp/Database.h>

#include <filesystem>

namespace stillmap {

// Every save marks the database with a random number. SQLite applies a log ("-wal") that a crash
// left to whatever database file has its name, also to a backup that was copied over the file; by
// the marks, such a log is found out: it does not go on from what the file holds.

/// Adds a mark within the transaction that is open. `log_was_empty`: all earlier saves are in the
/// file itself, so that marks before the last one are no longer needed.
void add_save_mark(SQLite::Database& database, bool log_was_empty);

/// Renames a log that is not this file's, so that the file is opened as it is alone; its name then
/// ends in "-wal.other". Does nothing where a process has the file open. Throws
/// std::filesystem::filesystem_error.
void put_away_other_log(const std::filesystem::path& file);

}  // namespace stillmap
