#include "core/map/storage/map_file_watch.hpp"

#include <SQLiteCpp/Exception.h>
#include <SQLiteCpp/Transaction.h>
#include <fcntl.h>
#include <sqlite3.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

#include "core/map/storage/map_database.hpp"

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

MapFileError not_visible(const fs::path& file, const std::string& why) {
  return {file, "cannot be looked at (" + why + "); nothing is written to it until it can"};
}

/// Throws MapFileError for a fault: an I/O error, a network that is away.
std::optional<FileState> checked(const fs::path& file, const std::optional<FileState>& state,
                                 const std::error_code& fault) {
  if (fault) throw not_visible(file, fault.message());
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
      writers_(file_),
      was_moved_(has_moved(database)),
      is_partly_written_(!has_empty_log()) {
  remember(database);
}

void MapFileWatch::remember(SQLite::Database& database) {
  try {
    look(database);
  } catch (const SQLite::Exception&) {
    // A failing disk; who reads or writes next says so.
    is_behind_ = true;
  }
  if (!log_) log_ = FileState::of(beside(file_, "-wal"));
  if (!log_index_) log_index_ = FileState::of(beside(file_, "-shm"));
}

void MapFileWatch::look(SQLite::Database& database) {
  const SQLite::Transaction one_state(database);
  Known now{.marks = save_marks(database),
            .shape = shape_of(database),
            .data_version = data_version(database)};
  if (known_ && (is_behind_ || now.data_version != known_->data_version)) {
    is_others_ |= known_->marks.empty()
                      ? !now.marks.empty()
                      : std::ranges::find(now.marks, known_->marks.back()) == now.marks.end();
  }
  known_ = std::move(now);
  is_behind_ = false;
}

MapFileFate MapFileWatch::fate(SQLite::Database& database) {
  if (!state_of_name(file_)) return MapFileFate::removed;
  if (!has_own_name()) return MapFileFate::replaced;
  try {
    // Another connection has written there.
    if (!known_ || is_behind_ || data_version(database) != known_->data_version) {
      look(database);
      is_partly_written_ |= !has_empty_log();
    }
    check_pages_after_others();
    if (is_others_) return MapFileFate::overwritten;
    return is_own_content(has_empty_log()) ? MapFileFate::kept : MapFileFate::overwritten;
  } catch (const SQLite::Exception& error) {
    if (is_of_content(error)) return MapFileFate::overwritten;
    throw not_visible(file_, error.what());
  }
}

void MapFileWatch::check_pages_after_others() {
  is_doubtful_ |= writers_.has_one_closed();
  if (!is_doubtful_ || is_others_) return;
  // With its log; opened for writing, this would be one more of the others.
  SQLite::Database alone(sqlite_name(file_), SQLite::OPEN_READONLY);
  is_others_ = alone.execAndGet("PRAGMA integrity_check(1)").getString() != "ok";
  is_doubtful_ = false;
}

bool MapFileWatch::has_own_name() const {
  std::error_code ignored;
  if (fs::is_symlink(fs::symlink_status(file_, ignored))) return false;
  return !was_moved_ && is_same_file(state_of_name(file_), opened_.state());
}

bool MapFileWatch::is_same_under_name() const {
  if (!known_ || is_behind_ || is_others_ || known_->marks.empty() || !has_empty_log())
    return false;
  try {
    const LastMark last = last_mark_without_log(file_);
    return last.is_readable && last.mark == known_->marks.back() && last.shape == known_->shape;
  } catch (const SQLite::Exception& error) {
    throw not_visible(file_, error.what());
  }
}

bool MapFileWatch::is_own_content(bool is_alone) const {
  if (!known_) return true;
  const std::vector<std::int64_t>& marks = known_->marks;
  const LastMark last = last_mark_without_log(file_);
  if (is_alone) {
    const auto own = marks.empty() ? std::nullopt : std::make_optional(marks.back());
    const bool is_last = last.is_readable && last.mark == own && last.shape == known_->shape;
    had_mark_ |= is_last && own.has_value();
    return is_last;
  }
  // While somebody reads, a log may be written into the file in parts.
  if (!last.is_readable) return is_partly_written_;
  if (!last.mark) return !had_mark_;
  const bool is_own = std::ranges::find(marks, *last.mark) != marks.end();
  had_mark_ |= is_own;
  return is_own;
}

bool MapFileWatch::has_empty_log() const {
  std::error_code fault;
  const std::uintmax_t bytes = fs::file_size(beside(file_, "-wal"), fault);
  if (fault && fault != std::errc::no_such_file_or_directory)
    throw not_visible(file_, "its log: " + fault.message());
  return fault || bytes == 0;
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
