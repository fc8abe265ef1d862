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

/// Tells whether an open database is still what lies under its name. A name is given to another
/// file by `rm`, `mv` and most editors; `cp` writes another content into the same file, and SQLite
/// would write its pages between those.
class MapFileWatch {
 public:
  /// Of a file that this connection has just opened.
  MapFileWatch(std::filesystem::path file, SQLite::Database& database);

  /// After every write of the connection, also one that failed.
  void remember(SQLite::Database& database);
  [[nodiscard]] MapFileFate fate(SQLite::Database& database);
  /// Whether the name is still that of the file that was opened.
  [[nodiscard]] bool has_own_name() const;
  /// Whether the file alone is what the connection left of it. Without a log, or with one of which
  /// nothing is in the file yet, it must be readable.
  [[nodiscard]] bool is_own_content(bool is_alone) const;
  /// Removes the log's files that this connection made or found, unless others have their names.
  [[nodiscard]] std::function<void()> log_removal() const;

 private:
  [[nodiscard]] bool has_empty_log() const;

  std::filesystem::path file_;
  /// Nothing where the name was another file's by then.
  std::optional<FileState> opened_;
  std::optional<FileState> log_;
  std::optional<FileState> log_index_;
  /// One of those is the file's last one; nothing where they could not be read.
  std::optional<std::vector<std::int64_t>> marks_;
  /// SQLite's, when the marks were read.
  std::int64_t data_version_ = -1;
};

}  // namespace stillmap
