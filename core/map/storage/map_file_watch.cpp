#include "core/map/storage/map_file_watch.hpp"

#include <SQLiteCpp/Exception.h>
#include <fcntl.h>
#include <sqlite3.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

#include "core/map/storage/map_database.hpp"
#include "core/map/storage/save_marks.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

bool is_same_file(const std::optional<FileState>& one, const std::optional<FileState>& other) {
  return one && other && one->device == other->device && one->number == other->number;
}

std::int64_t data_version(SQLite::Database& database) {
  return database.execAndGet("PRAGMA data_version").getInt64();
}

/// Whether the name was given to another file since the connection opened it.
bool has_moved(SQLite::Database& database) {
  int moved = 0;
  const int result =
      sqlite3_file_control(database.getHandle(), "main", SQLITE_FCNTL_HAS_MOVED, &moved);
  return result == SQLITE_OK && moved != 0;
}

/// Throws MapFileError for a fault: an I/O error, a network that is away.
std::optional<FileState> checked(const fs::path& file, const std::optional<FileState>& state,
                                 const std::error_code& fault) {
  if (fault) {
    throw MapFileError(file, "cannot be looked at (" + fault.message() +
                                 "); nothing is written to it until it can");
  }
  return state;
}

std::optional<FileState> state_of_name(const fs::path& file) {
  std::error_code fault;
  const auto state = FileState::of(file, fault);
  return checked(file, state, fault);
}

}  // namespace

FileReference::FileReference(const fs::path& file)
    : file_(file), descriptor_(::open(file.c_str(), O_PATH | O_CLOEXEC)) {
  if (descriptor_ >= 0 || errno == ENOENT || errno == ENOTDIR) return;
  checked(file, std::nullopt, std::error_code(errno, std::generic_category()));
}

FileReference::~FileReference() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

std::optional<FileState> FileReference::state() const {
  if (descriptor_ < 0) return std::nullopt;
  std::error_code fault;
  const auto state = FileState::of(descriptor_, fault);
  return checked(file_, state, fault);
}

MapFileWatch::MapFileWatch(fs::path file, SQLite::Database& database)
    : file_(std::move(file)),
      opened_(file_),
      was_moved_(has_moved(database)),
      is_partly_written_(!has_empty_log()) {
  remember(database);
}

void MapFileWatch::remember(SQLite::Database& database) {
  try {
    marks_ = save_marks(database);
    data_version_ = data_version(database);
  } catch (const SQLite::Exception&) {
    // A failing disk; who reads or writes next says so.
    marks_.reset();
  }
  if (!log_) log_ = FileState::of(beside(file_, "-wal"));
  if (!log_index_) log_index_ = FileState::of(beside(file_, "-shm"));
}

MapFileFate MapFileWatch::fate(SQLite::Database& database) {
  if (!state_of_name(file_)) return MapFileFate::removed;
  if (!has_own_name()) return MapFileFate::replaced;
  try {
    // Another connection has saved there.
    if (data_version(database) != data_version_) {
      remember(database);
      is_partly_written_ |= !has_empty_log();
    }
  } catch (const SQLite::Exception&) {
    return MapFileFate::overwritten;
  }
  return is_own_content(has_empty_log()) ? MapFileFate::kept : MapFileFate::overwritten;
}

bool MapFileWatch::has_own_name() const {
  return !was_moved_ && is_same_file(state_of_name(file_), opened_.state());
}

bool MapFileWatch::is_same_under_name() const {
  if (!marks_ || marks_->empty() || !has_empty_log()) return false;
  const LastMark last = last_mark_without_log(file_);
  return last.is_readable && last.mark == marks_->back();
}

bool MapFileWatch::is_own_content(bool is_alone) const {
  if (!marks_) return true;
  const LastMark last = last_mark_without_log(file_);
  if (is_alone) {
    const auto own = marks_->empty() ? std::nullopt : std::make_optional(marks_->back());
    const bool is_last = last.is_readable && last.mark == own;
    had_mark_ |= is_last && own.has_value();
    return is_last;
  }
  // While somebody reads, a log may be written into the file in parts.
  if (!last.is_readable) return is_partly_written_;
  if (!last.mark) return !had_mark_;
  const bool is_own = std::ranges::find(*marks_, *last.mark) != marks_->end();
  had_mark_ |= is_own;
  return is_own;
}

bool MapFileWatch::has_empty_log() const {
  std::error_code none_there;
  const std::uintmax_t bytes = fs::file_size(beside(file_, "-wal"), none_there);
  return none_there || bytes == 0;
}

std::function<void()> MapFileWatch::log_removal() const {
  return [file = file_, log = log_, index = log_index_] {
    std::error_code ignored;
    for (const auto& [suffix, own] : {std::pair("-wal", log), std::pair("-shm", index)}) {
      const fs::path name = beside(file, suffix);
      if (is_same_file(FileState::of(name), own)) fs::remove(name, ignored);
    }
  };
}

}  // namespace stillmap
