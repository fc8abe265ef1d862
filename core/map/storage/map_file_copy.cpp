#include "core/map/storage/map_file_copy.hpp"

#include <SQLiteCpp/Database.h>
#include <SQLiteCpp/Exception.h>

#include <fstream>
#include <memory>
#include <string>
#include <system_error>
#include <utility>

#include "core/map/storage/map_database.hpp"
#include "core/map/storage/read_lease.hpp"
#include "core/map/storage/save_marks.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

fs::path readable(fs::path file) {
  std::error_code error;
  if (!fs::exists(file, error))
    throw MapFileError(file,
                       "is not there; name a map file, as the map.stillmap of 'stillmap map'");
  if (!fs::is_regular_file(file, error)) throw MapFileError(file, "is not a file; name a map file");
  if (fs::file_size(file, error) == 0) throw MapFileError(file, "is empty; name a map file");
  if (!std::ifstream(file, std::ios::binary)) {
    throw MapFileError(file, "cannot be read; check its permissions");
  }
  return file;
}

TemporaryFolder folder_for_copy_of(const fs::path& file) {
  try {
    return TemporaryFolder(fs::temp_directory_path() / "stillmap-read-",
                           TemporaryFolder::OfTheDead::remove);
  } catch (const fs::filesystem_error& error) {
    throw MapFileWriteError(
        file, std::string("cannot be copied to a temporary folder to be read (") + error.what() +
                  "); set TMPDIR to a folder that can be written");
  }
}

/// A read transaction on a file that a server may have open: while it lasts, the log is not
/// checkpointed, so that file and log agree when they are copied one after the other. Null when
/// SQLite refuses: opening the copy reports the reason.
std::unique_ptr<SQLite::Database> hold(const fs::path& file) {
  if (!fs::exists(beside(file, "-wal")) || !fs::exists(beside(file, "-shm"))) return nullptr;
  try {
    constexpr int busy_timeout_ms = 5000;
    auto database = std::make_unique<SQLite::Database>(sqlite_name(file), SQLite::OPEN_READONLY,
                                                       busy_timeout_ms);
    database->exec("BEGIN");
    static_cast<void>(database->execAndGet("SELECT count(*) FROM sqlite_master").getInt());
    return database;
  } catch (const SQLite::Exception&) {
    return nullptr;
  }
}

/// Again where another file got the name meanwhile: the size would be that of the one before.
void copy_whole(const fs::path& file, const fs::path& copy) {
  constexpr int max_attempts = 20;
  for (int attempt = 0; attempt < max_attempts; ++attempt) {
    const auto before = FileState::of(file);
    fs::copy_file(file, copy, fs::copy_options::overwrite_existing);
    if (FileState::of(file) == before) return;
  }
}

void copy_with_log(const fs::path& file, const fs::path& copy) {
  const std::unique_ptr<SQLite::Database> held = hold(file);
  copy_whole(file, copy);
  // A source that cannot be written must not make the copy so.
  fs::permissions(copy, fs::perms::owner_read | fs::perms::owner_write, fs::perm_options::add);
  const fs::path log = beside(file, "-wal");
  if (!fs::exists(log)) return;
  fs::copy_file(log, beside(copy, "-wal"));
  put_away_other_log(copy);
}

}  // namespace

MapFileError error_of(const fs::path& file, const fs::path& copy, const MapFileError& error) {
  const std::string text = error.what();
  const std::string name = copy.string() + ": ";
  return {file, text.starts_with(name) ? text.substr(name.size()) : text};
}

MapFileCopy::MapFileCopy(fs::path file)
    : file_(readable(std::move(file))),
      folder_(folder_for_copy_of(file_)),
      copy_(folder_.path() / "map.stillmap") {
  try {
    copy_with_log(real_file(file_), copy_);
  } catch (const fs::filesystem_error& error) {
    throw MapFileWriteError(file_, std::string("cannot be copied to be read (") + error.what() +
                                       "); make room there, or set TMPDIR to a folder with room");
  }
}

void MapFileCopy::check_format() const {
  try {
    static_cast<void>(open_map_file(copy_));
  } catch (const MapFileError& error) {
    throw error_of(file_, copy_, error);
  }
}

SavedMap MapFileCopy::load() const {
  try {
    return open_map_file(copy_)->load();
  } catch (const MapFileError& error) {
    throw error_of(file_, copy_, error);
  }
}

SavedMap read_map_file(const fs::path& file) { return MapFileCopy(file).load(); }

}  // namespace stillmap
