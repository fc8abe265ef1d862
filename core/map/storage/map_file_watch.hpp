#pragma once

#include <SQLiteCpp/Database.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "core/map/storage/map_file.hpp"
#include "core/map/storage/read_lease.hpp"

namespace stillmap {

/// Keeps hold of a file without opening it: closing a file that was opened would release the locks
/// that SQLite has on it.
class FileReference {
 public:
  /// Throws MapFileError where it cannot be had; refers to nothing where there is no such file.
  explicit FileReference(const std::filesystem::path& file);
  ~FileReference();
  FileReference(const FileReference&) = delete;
  FileReference& operator=(const FileReference&) = delete;
  FileReference(FileReference&&) = delete;
  FileReference& operator=(FileReference&&) = delete;

  /// As it is now: some file systems give files other numbers while they are open. Nothing without
  /// a file. Throws MapFileError.
  [[nodiscard]] std::optional<FileState> state() const;

 private:
  std::filesystem::path file_;
  int descriptor_;
};

/// Tells whether an open database is still what lies under its name. A name is given to another
/// file by `rm`, `mv` and most editors; `cp` writes another content into the same file, and SQLite
/// would write its pages between those.
class MapFileWatch {
 public:
  /// Of a file that this connection has just opened.
  MapFileWatch(std::filesystem::path file, SQLite::Database& database);

  /// After every write of the connection, also one that failed.
  void remember(SQLite::Database& database);
  /// Throws MapFileError where the file cannot be looked at: that says nothing of its fate.
  [[nodiscard]] MapFileFate fate(SQLite::Database& database);
  /// Whether another file has the name, in the very state that the connection left its own in.
  [[nodiscard]] bool is_same_under_name() const;
  /// Around every writing of the log into the file: one that was not finished leaves it unreadable
  /// without the log.
  void set_partly_written(bool is_partly_written) { is_partly_written_ = is_partly_written; }
  /// Whether the name is still that of the file that was opened. Throws as `fate`.
  [[nodiscard]] bool has_own_name() const;
  /// Whether the file alone is what the connection left of it. It must be readable unless a log was
  /// written into it in part.
  [[nodiscard]] bool is_own_content(bool is_alone) const;
  /// Removes the log's files that this connection made or found, unless others have their names.
  [[nodiscard]] std::function<void()> log_removal() const;

 private:
  [[nodiscard]] bool has_empty_log() const;

  std::filesystem::path file_;
  FileReference opened_;
  /// The name was another file's by then.
  bool was_moved_;
  /// A log that was there at first, or was changed by others, may have been written in part.
  bool is_partly_written_;
  /// A file that was once saved with a mark never has none again.
  mutable bool had_mark_ = false;
  std::optional<FileState> log_;
  std::optional<FileState> log_index_;
  /// One of those is the file's last one; nothing where they could not be read.
  std::optional<std::vector<std::int64_t>> marks_;
  /// SQLite's, when the marks were read.
  std::int64_t data_version_ = -1;
};

}  // namespace stillmap
