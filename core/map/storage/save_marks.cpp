#include "core/map/storage/save_marks.hpp"

#include <SQLiteCpp/Exception.h>
#include <SQLiteCpp/Statement.h>
#include <sqlite3.h>

#include <algorithm>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <system_error>
#include <vector>

#include "core/map/storage/map_database.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

/// The log's own header; a log without more has nothing to apply.
constexpr std::uintmax_t log_header_bytes = 32;

std::int64_t random_mark() {
  std::random_device entropy;
  return static_cast<std::int64_t>(entropy()) << 32 | entropy();
}

bool is_sound(SQLite::Database& database) {
  return database.execAndGet("PRAGMA quick_check(1)").getString() == "ok";
}

bool is_sound_without_log(const fs::path& file) {
  try {
    SQLite::Database alone(uri_without_log(file), SQLite::OPEN_READONLY | SQLite::OPEN_URI);
    return is_sound(alone);
  } catch (const SQLite::Exception&) {
    return false;
  }
}

/// Whether the log goes on from this state of the file.
bool is_log_of(const fs::path& file) {
  try {
    SQLite::Database database(sqlite_name(file), SQLite::OPEN_READWRITE);
    sqlite3_db_config(database.getHandle(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
    // Busy where any process has the file open: then the log is in use.
    database.exec("PRAGMA locking_mode = EXCLUSIVE");
    static_cast<void>(database.tableExists("saves"));
    // Nothing where the file cannot be read without its log, as when a crash came while the log was
    // written into it.
    const auto last = last_mark_without_log(file).mark;
    if (!last) return true;
    const std::vector<std::int64_t> with_log = save_marks(database);
    if (std::ranges::find(with_log, *last) == with_log.end()) return false;
    // The file has the newest mark where a crash came while the log was written into it, and also
    // where the log is another file's, which had its marks in another page.
    return with_log.back() != *last || is_sound(database) || !is_sound_without_log(file);
  } catch (const SQLite::Exception& error) {
    const bool is_damaged =
        error.getErrorCode() == SQLITE_CORRUPT || error.getErrorCode() == SQLITE_NOTADB;
    return !is_damaged || !is_sound_without_log(file);
  }
}

void insert_mark(SQLite::Database& database) {
  SQLite::Statement insert(database, "INSERT INTO saves VALUES (?)");
  insert.bind(1, random_mark());
  insert.exec();
}

constexpr const char* marks_table = "CREATE TABLE IF NOT EXISTS saves (mark INTEGER NOT NULL)";

}  // namespace

void add_save_mark(SQLite::Database& database, bool log_was_empty) {
  database.exec(marks_table);
  if (log_was_empty) {
    database.exec("DELETE FROM saves WHERE rowid < (SELECT max(rowid) FROM saves)");
  }
  insert_mark(database);
}

void begin_save_marks(SQLite::Database& database) {
  database.exec(marks_table);
  database.exec("DELETE FROM saves");
  insert_mark(database);
}

std::vector<std::int64_t> save_marks(SQLite::Database& database) {
  std::vector<std::int64_t> all;
  if (!database.tableExists("saves")) return all;
  SQLite::Statement row(database, "SELECT mark FROM saves ORDER BY rowid");
  while (row.executeStep()) all.push_back(row.getColumn(0).getInt64());
  return all;
}

DatabaseShape shape_of(SQLite::Database& database) {
  return {.pages = database.execAndGet("PRAGMA page_count").getInt64(),
          .schema = database.execAndGet("PRAGMA schema_version").getInt64()};
}

LastMark last_mark_without_log(const fs::path& file) {
  // To open a pipe is to wait for who writes into it.
  std::error_code not_there;
  if (fs::exists(file, not_there) && !fs::is_regular_file(file, not_there)) return {};
  try {
    SQLite::Database alone(uri_without_log(file), SQLite::OPEN_READONLY | SQLite::OPEN_URI);
    const std::vector<std::int64_t> all = save_marks(alone);
    return {.is_readable = true,
            .mark = all.empty() ? std::nullopt : std::make_optional(all.back()),
            .shape = shape_of(alone)};
  } catch (const SQLite::Exception& error) {
    if (!is_of_content(error)) throw;
    return {};
  }
}

bool is_of_content(const SQLite::Exception& error) {
  constexpr int primary_code = 0xFF;
  switch (error.getErrorCode() & primary_code) {
    case SQLITE_IOERR:
    case SQLITE_CANTOPEN:
    case SQLITE_NOMEM:
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
    case SQLITE_PROTOCOL:
    case SQLITE_PERM:
    case SQLITE_AUTH:
    case SQLITE_READONLY:
    case SQLITE_FULL:
    case SQLITE_NOLFS:
    case SQLITE_INTERRUPT:
      return false;
    default:
      return true;
  }
}

void put_away_other_log(const fs::path& file) {
  const fs::path log = beside(file, "-wal");
  std::error_code none_there;
  const std::uintmax_t bytes = fs::file_size(log, none_there);
  if (none_there || bytes <= log_header_bytes || is_log_of(file)) return;
  fs::rename(log, beside(file, "-wal.other"));
  fs::remove(beside(file, "-shm"));
}

}  // namespace stillmap
