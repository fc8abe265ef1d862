#include "core/map/storage/map_database.hpp"

#include <SQLiteCpp/Exception.h>
#include <SQLiteCpp/Statement.h>
#include <SQLiteCpp/Transaction.h>
#include <fcntl.h>
#include <sqlite3.h>
#include <unistd.h>

#include <cctype>
#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <string>
#include <string_view>
#include <system_error>

#include "core/map/storage/fresh_map_file.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/map/storage/save_marks.hpp"
#include "core/map/storage/tile_codec.hpp"

namespace stillmap {

std::filesystem::path beside(const std::filesystem::path& file, const char* suffix) {
  std::filesystem::path path = file;
  path += suffix;
  return path;
}

std::string sqlite_name(const std::filesystem::path& file) {
  return std::filesystem::absolute(file).string();
}

std::string uri_without_log(const std::filesystem::path& file) {
  constexpr std::string_view digits = "0123456789ABCDEF";
  std::string uri = "file:";
  for (const char letter : sqlite_name(file)) {
    const auto byte = static_cast<unsigned char>(letter);
    if (std::isalnum(byte) != 0 || letter == '/') {
      uri += letter;
    } else {
      uri += {'%', digits[byte >> 4], digits[byte & 15]};
    }
  }
  return uri + "?immutable=1";
}

namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t application_id = 0x53744D70;  // "StMp"
constexpr std::uint32_t schema_version = 2;
constexpr std::uint32_t oldest_schema_version = 1;
constexpr int busy_timeout_ms = 5000;
/// SQLite's own limit; what lies beyond is read as ever.
constexpr std::uint32_t max_mapped_bytes = 0x7FFF0000;

constexpr const char* schema = R"sql(
  CREATE TABLE map (
    only_row INTEGER PRIMARY KEY CHECK (only_row = 0),
    map_id INTEGER NOT NULL, version INTEGER NOT NULL,
    tile_size_m REAL NOT NULL, voxel_size_m REAL NOT NULL);
  CREATE TABLE tiles (
    x INTEGER NOT NULL, y INTEGER NOT NULL,
    revision INTEGER NOT NULL, content_hash INTEGER NOT NULL,
    encoded BLOB NOT NULL,
    voxel_count INTEGER NOT NULL DEFAULT 0,
    min_x REAL, min_y REAL, min_z REAL, max_x REAL, max_y REAL, max_z REAL,
    PRIMARY KEY (x, y));
  CREATE TABLE trajectory (
    position INTEGER PRIMARY KEY, stamp_ns INTEGER NOT NULL,
    x REAL NOT NULL, y REAL NOT NULL, z REAL NOT NULL,
    qx REAL NOT NULL, qy REAL NOT NULL, qz REAL NOT NULL, qw REAL NOT NULL);
  CREATE TABLE metadata (key TEXT PRIMARY KEY, value TEXT NOT NULL);
)sql";

/// The last page of a tile is half empty: small pages waste little.
constexpr std::uint32_t page_bytes = 1024;

constexpr const char* evidence_table = R"sql(
  CREATE TABLE memories (
    x INTEGER NOT NULL, y INTEGER NOT NULL, encoded BLOB NOT NULL,
    PRIMARY KEY (x, y));
)sql";

/// All that is known of tiles without reading their voxels, in the order of ids.
constexpr const char* tile_info_index = R"sql(
  CREATE INDEX IF NOT EXISTS tile_infos ON tiles (
    x, y, revision, content_hash, voxel_count, min_x, min_y, min_z, max_x, max_y, max_z);
)sql";

/// SQLite's file header has its numbers big-endian.
std::uint32_t big_endian(std::string_view bytes) {
  std::uint32_t value = 0;
  for (const char byte : bytes) value = value << 8 | static_cast<std::uint8_t>(byte);
  return value;
}

constexpr std::size_t header_bytes = 100;

/// Reads the header as plain bytes: SQLite itself might already repair or create something. Empty
/// where the file is no SQLite database.
std::string header_of(const fs::path& file) {
  constexpr std::string_view magic("SQLite format 3\0", 16);
  std::string header(header_bytes, '\0');
  std::ifstream stream(file, std::ios::binary);
  stream.read(header.data(), header_bytes);
  return stream && header.starts_with(magic) ? header : std::string();
}

std::uint32_t application_of(std::string_view header) { return big_endian(header.substr(68, 4)); }

void check_header(const fs::path& file) {
  const std::string bytes = header_of(file);
  const std::string_view header = bytes;
  if (header.empty()) {
    throw UnusableMapFileError(file, "is not a map file (no SQLite database); name another file");
  }
  if (application_of(header) != application_id) {
    throw UnusableMapFileError(file, "is a database of another program; name another file");
  }
  const std::uint32_t version = big_endian(header.substr(60, 4));
  if (version > schema_version) {
    throw UnusableMapFileError(file, "was written by a newer Stillmap (schema " +
                                         std::to_string(version) + ", this one knows " +
                                         std::to_string(schema_version) + "); update this program");
  }
  if (version < oldest_schema_version) {
    throw UnusableMapFileError(file, "is damaged: it has schema " + std::to_string(version));
  }
}

/// For renames to survive a power cut.
void sync_folder(const fs::path& file) {
  const int descriptor = ::open(fs::absolute(file).parent_path().c_str(), O_RDONLY | O_DIRECTORY);
  if (descriptor < 0) return;
  // Some file systems cannot sync folders; then there is nothing that could be done.
  static_cast<void>(::fsync(descriptor));
  ::close(descriptor);
}

void set_number(SQLite::Database& database, const std::string& pragma, std::uint32_t number) {
  database.exec("PRAGMA " + pragma + " = " + std::to_string(number));
}

/// Made under another name and then renamed, so that an incomplete file never has this name.
void create(const fs::path& file) {
  for (const char* suffix : {"-wal", "-shm"}) {
    std::error_code none_there;
    fs::remove(beside(file, suffix), none_there);
  }
  const FreshMapFile fresh(file);
  {
    SQLite::Database database(sqlite_name(fresh.path()),
                              SQLite::OPEN_READWRITE | SQLite::OPEN_CREATE);
    set_number(database, "page_size", page_bytes);
    SQLite::Transaction transaction(database);
    set_number(database, "application_id", application_id);
    set_number(database, "user_version", schema_version);
    database.exec(schema);
    database.exec(evidence_table);
    database.exec(tile_info_index);
    begin_save_marks(database);
    transaction.commit();
    database.exec("PRAGMA journal_mode = WAL");
  }
  fs::rename(fresh.path(), file);
  sync_folder(file);
}

/// By one of SQLite's pragmas. Not only pages: the index of tiles must say what their rows do.
void check_integrity(SQLite::Database& database, const fs::path& file, const std::string& pragma) {
  SQLite::Statement check(database, "PRAGMA " + pragma);
  check.executeStep();
  if (const std::string verdict = check.getColumn(0).getString(); verdict != "ok") {
    throw UnusableMapFileError(file,
                               "is damaged (" + verdict + "); restore a copy or name another file");
  }
}

void check_pages(SQLite::Database& database, const fs::path& file) {
  if (fs::file_size(file) > max_checked_bytes) return;
  // A log left by a crash must not be written into a file that turns out to be damaged.
  const bool has_log = fs::exists(beside(file, "-wal"));
  sqlite3_db_config(database.getHandle(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, has_log ? 1 : 0,
                    nullptr);
  check_integrity(database, file, "integrity_check(1)");
  sqlite3_db_config(database.getHandle(), SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 0, nullptr);
}

SQLite::Database connect(const fs::path& file) {
  SQLite::Database database(sqlite_name(file), SQLite::OPEN_READWRITE, busy_timeout_ms);
  // FULL: a save that returned survives a power cut, not only a crash.
  database.exec("PRAGMA synchronous = FULL");
  return database;
}

SQLite::Database open_or_create(const fs::path& file) {
  if (!fs::exists(file) || (fs::is_regular_file(file) && fs::file_size(file) == 0)) create(file);
  if (!fs::is_regular_file(file))
    throw UnusableMapFileError(file, "is not a file; name another one");
  check_header(file);
  put_away_other_log(file);
  SQLite::Database database = connect(file);
  check_pages(database, file);
  return database;
}

void read_as_memory(SQLite::Database& database) {
  database.exec("PRAGMA mmap_size = " + std::to_string(max_mapped_bytes));
}

/// What `open` returns; its errors as MapFileError.
template <typename Open>
SQLite::Database opened(const fs::path& file, Open open) {
  try {
    return open(file);
  } catch (const SQLite::Exception& error) {
    const bool is_damaged =
        error.getErrorCode() == SQLITE_CORRUPT || error.getErrorCode() == SQLITE_NOTADB;
    if (is_damaged) {
      throw UnusableMapFileError(file, std::string("is damaged (") + error.what() +
                                           "); restore a copy or name another file");
    }
    throw MapFileError(file, std::string("cannot be opened (") + error.what() +
                                 "); its folder must exist and be writable");
  } catch (const fs::filesystem_error& error) {
    throw MapFileError(file, std::string("cannot be opened (") + error.what() +
                                 "); its folder must exist and be writable");
  }
}

/// A stored tile's counts and bounds, for its new columns.
void fill_in_infos(SQLite::Database& database) {
  SQLite::Statement sizes(database, "SELECT voxel_size_m, tile_size_m FROM map");
  if (!sizes.executeStep()) return;
  const VoxelGrid grid =
      stored_grid(sizes.getColumn(0).getDouble(), sizes.getColumn(1).getDouble());
  SQLite::Statement row(database, "SELECT x, y, encoded FROM tiles");
  SQLite::Statement update(database,
                           "UPDATE tiles SET voxel_count = ?, min_x = ?, min_y = ?, min_z = ?, "
                           "max_x = ?, max_y = ?, max_z = ? WHERE x = ? AND y = ?");
  while (row.executeStep()) {
    const SQLite::Column blob = row.getColumn(2);
    const TileInfo info = decode_tile({static_cast<const std::uint8_t*>(blob.getBlob()),
                                       static_cast<std::size_t>(blob.getBytes())},
                                      grid)
                              .info;
    update.bind(1, info.voxel_count);
    for (int axis = 0; axis < 3; ++axis) {
      update.bind(2 + axis, static_cast<double>(info.bounds_map.min()[axis]));
      update.bind(5 + axis, static_cast<double>(info.bounds_map.max()[axis]));
    }
    update.bind(8, row.getColumn(0).getInt());
    update.bind(9, row.getColumn(1).getInt());
    update.exec();
    update.reset();
  }
}

}  // namespace

bool has_first_schema(SQLite::Database& database) {
  return database.execAndGet("PRAGMA user_version").getInt() == oldest_schema_version;
}

void upgrade_schema(SQLite::Database& database) {
  SQLite::Transaction transaction(database, SQLite::TransactionBehavior::IMMEDIATE);
  database.exec("ALTER TABLE tiles ADD COLUMN voxel_count INTEGER NOT NULL DEFAULT 0");
  for (const char* column : {"min_x", "min_y", "min_z", "max_x", "max_y", "max_z"}) {
    database.exec(std::string("ALTER TABLE tiles ADD COLUMN ") + column + " REAL");
  }
  database.exec(evidence_table);
  fill_in_infos(database);
  set_number(database, "user_version", schema_version);
  transaction.commit();
}

void index_tile_infos(SQLite::Database& database) { database.exec(tile_info_index); }

SQLite::Database open_map_database(const fs::path& file) { return opened(file, open_or_create); }

SQLite::Database open_map_copy(const fs::path& file) {
  return opened(file, [](const fs::path& copy) {
    check_header(copy);
    put_away_other_log(copy);
    SQLite::Database database = connect(copy);
    read_as_memory(database);
    return database;
  });
}

SQLite::Database open_map_in_place(const fs::path& file) {
  return opened(file, [](const fs::path& held) {
    check_header(held);
    SQLite::Database database(uri_without_log(held), SQLite::OPEN_READONLY | SQLite::OPEN_URI);
    read_as_memory(database);
    return database;
  });
}

void check_shown_tables(SQLite::Database& database, const fs::path& file) {
  if (fs::file_size(file) > max_checked_bytes) return;
  for (const char* table : {"map", "tiles", "trajectory", "metadata"}) {
    check_integrity(database, file, std::string("integrity_check(") + table + ")");
  }
}

SQLite::Database connect_to_map_database(const fs::path& file) { return opened(file, connect); }

bool is_map_file(const fs::path& file) {
  std::error_code not_there;
  if (!fs::is_regular_file(file, not_there)) return false;
  const std::string header = header_of(file);
  return !header.empty() && application_of(header) == application_id;
}

void put_in_place(const fs::path& fresh, const fs::path& file) {
  if (fs::exists(beside(file, "-wal"))) {
    try {
      // Closed again, it has no log: what is there stays complete until the rename.
      static_cast<void>(open_map_database(file));
    } catch (const MapFileError&) {
      // Not worth keeping complete.
    }
  }
  for (const char* suffix : {"-wal", "-shm"}) fs::remove(beside(file, suffix));
  fs::rename(fresh, file);
  sync_folder(file);
}

bool put_in_free_place(const fs::path& fresh, const fs::path& file) {
  if (::renameat2(AT_FDCWD, fresh.c_str(), AT_FDCWD, file.c_str(), RENAME_NOREPLACE) != 0) {
    // Not every file system knows that; the others that do not know links either are refused.
    const bool is_unknown = errno == EINVAL || errno == ENOSYS;
    if (!is_unknown || ::link(fresh.c_str(), file.c_str()) != 0) {
      if (errno == EEXIST) return false;
      throw fs::filesystem_error("rename", fresh, file,
                                 std::error_code(errno, std::generic_category()));
    }
  }
  sync_folder(file);
  return true;
}

}  // namespace stillmap
