#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "core/process/temporary_folder.hpp"

namespace stillmap {

/// A map file that is made beside the one whose place it is to take, or which a link of that name
/// leads to. It lies in a folder of its own, "NAME.new-" and six letters more, so that neither it
/// nor what SQLite puts beside it is ever a file of somebody else. Where it did not take the place,
/// it goes with the object.
class FreshMapFile {
 public:
  enum class Writing : std::uint8_t {
    /// What is there, once it is a whole map, is the map that was to be written.
    at_once,
    /// It is changed after it was written whole, and made of maps that stay: what a killed process
    /// leaves of it is of no use.
    in_steps
  };
  /// Throws std::filesystem::filesystem_error.
  explicit FreshMapFile(const std::filesystem::path& file, Writing writing = Writing::at_once);

  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  TemporaryFolder folder_;
  std::filesystem::path path_;
};

/// What a killed process left of a fresh map file.
struct LeftFreshFile {
  std::filesystem::path path;
  /// The file that it was to become.
  std::filesystem::path name;
};

/// Those of this file, the newest first. For who holds its lock (MapLock) and has made none yet.
[[nodiscard]] std::vector<LeftFreshFile> left_fresh_files(const std::filesystem::path& file);

/// Those of files beside `file` that have its name with a time, and it may be a number, in it:
/// "city.2026-05-31_142500.stillmap" and "city.2026-05-31_142500.2.stillmap" beside
/// "city.stillmap". Another process may be making one now: then it holds the lock of its name.
[[nodiscard]] std::vector<LeftFreshFile> left_fresh_files_beside(const std::filesystem::path& file);

/// How much of a map is in what was left.
enum class LeftContent : std::uint8_t {
  /// Nothing, or no more than what it was made of has.
  none,
  /// A part, or something that is no map.
  unfinished,
  /// What is in it could not be found out: rights, the disk, another process. It may be whole.
  unreadable,
  whole
};
/// Reads all of the file, and leaves a part as it is: SQLite, once it opens it, would take back
/// what was not finished.
[[nodiscard]] LeftContent left_content(const LeftFreshFile& left);

/// Gives a whole one this name; false where a file has it. Throws
/// std::filesystem::filesystem_error.
[[nodiscard]] bool keep_fresh_file(const LeftFreshFile& left, const std::filesystem::path& name);

/// Removes it with its folder.
void remove_fresh_file(const LeftFreshFile& left);

/// Removes those of `file` that are of no use to anybody: without content, and, where a file has
/// the name, parts of what was to replace it. For who is about to write `file`, under its lock.
void remove_useless_fresh_files(const std::filesystem::path& file);

}  // namespace stillmap
