#pragma once

#include <SQLiteCpp/Database.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "core/map/storage/map_file.hpp"
#include "core/map/storage/read_lease.hpp"
#include "core/map/storage/save_marks.hpp"
#include "core/map/storage/writer_watch.hpp"

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

  /// After every write of the connection, also one that failed, and after one of another
  /// connection.
  void remember(SQLite::Database& database);
  /// Throws MapFileError where the file cannot be looked at: that says nothing of its fate.
  [[nodiscard]] MapFileFate fate(SQLite::Database& database);
  /// What others wrote does not go on from what the connection saved last: file and log were
  /// written over together.
  [[nodiscard]] bool is_others() const { return is_others_; }
  /// Whether another file has the name, in the very state that the connection left its own in.
  /// Throws as `fate`.
  [[nodiscard]] bool is_same_under_name() const;
  /// Around every writing of the log into the file: one that was not finished leaves it unreadable
  /// without the log.
  void set_partly_written(bool is_partly_written) { is_partly_written_ = is_partly_written; }
  /// Whether the name is still that of the file that was opened, and no link to it: beside that,
  /// others look for its log and its lock. Throws as `fate`.
  [[nodiscard]] bool has_own_name() const;
  /// Whether the file alone is what the connection left of it. It must be readable unless a log was
  /// written into it in part. Throws SQLite::Exception for a fault of the disk.
  [[nodiscard]] bool is_own_content(bool is_alone) const;
  /// Removes the log's files that this connection made or found, unless others have their names.
  [[nodiscard]] std::function<void()> log_removal() const;
  [[nodiscard]] bool has_empty_log() const;

 private:
  struct Known {
    /// One of those is the file's last one.
    std::vector<std::int64_t> marks;
    DatabaseShape shape;
    /// SQLite's, when the marks were read.
    std::int64_t data_version = -1;
  };
  /// Throws SQLite::Exception.
  void look(SQLite::Database& database);
  /// Of a file that another process may have written to: a copy that met the moment in which a log
  /// was written into the file has the newest mark, and pages of both.
  void check_pages_after_others();

  std::filesystem::path file_;
  FileReference opened_;
  WriterWatch writers_;
  /// One had it open, and what is in it was not checked since.
  bool is_doubtful_ = false;
  /// The name was another file's by then.
  bool was_moved_;
  /// A log that was there at first, or was changed by others, may have been written in part.
  bool is_partly_written_;
  /// A file that was once saved with a mark never has none again.
  mutable bool had_mark_ = false;
  std::optional<FileState> log_;
  std::optional<FileState> log_index_;
  /// Nothing where it could not be read yet.
  std::optional<Known> known_;
  /// It could not be read after the last write.
  bool is_behind_ = false;
  bool is_others_ = false;
};

}  // namespace stillmap
