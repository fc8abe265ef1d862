#include "core/map/storage/fresh_map_file.hpp"

#include <SQLiteCpp/Database.h>

#include <algorithm>
#include <functional>
#include <stdexcept>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "core/map/storage/map_database.hpp"
#include "core/map/storage/map_file.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

constexpr const char* folder_suffix = ".new-";
/// With the six letters after it.
constexpr std::size_t ending_of_folder = 11;
constexpr const char* name_in_folder = "unfinished.stillmap";

std::vector<fs::path> entries_of(const fs::path& folder) {
  std::vector<fs::path> entries;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error); !error && entry != fs::directory_iterator();
       entry.increment(error)) {
    entries.push_back(entry->path());
  }
  return entries;
}

/// Whether it has no more in it than a fresh map file and what SQLite puts beside that.
bool is_of_fresh_file(const fs::path& folder) {
  std::error_code error;
  if (fs::symlink_status(folder, error).type() != fs::file_type::directory) return false;
  for (const fs::path& entry : entries_of(folder)) {
    if (!entry.filename().string().starts_with(name_in_folder)) return false;
  }
  return true;
}

/// In this folder, of files whose name is one of those; the newest first.
std::vector<LeftFreshFile> left_fresh_files_where(
    const fs::path& folder, const std::function<bool(const std::string& name)>& is_wanted) {
  std::vector<std::pair<fs::file_time_type, LeftFreshFile>> found;
  for (const fs::path& entry : entries_of(folder)) {
    std::string name = entry.filename().string();
    const std::size_t end = name.rfind(folder_suffix);
    if (end == std::string::npos || name.size() - end != ending_of_folder) continue;
    name.resize(end);
    if (!is_wanted(name) || !is_of_fresh_file(entry)) continue;
    std::error_code unknown;
    const fs::path fresh = entry / name_in_folder;
    found.push_back({fs::last_write_time(fresh, unknown), {fresh, folder / name}});
  }
  std::ranges::stable_sort(found, std::ranges::greater(),
                           [](const auto& each) { return each.first; });
  std::vector<LeftFreshFile> files;
  for (auto& [written, left] : found) files.push_back(std::move(left));
  return files;
}

}  // namespace

FreshMapFile::FreshMapFile(const fs::path& file)
    : folder_(beside(real_file(file), folder_suffix)), path_(folder_.path() / name_in_folder) {}

std::vector<LeftFreshFile> left_fresh_files(const fs::path& file) {
  const fs::path real = real_file(file);
  return left_fresh_files_where(real.parent_path(), [&](const std::string& name) {
    return name == real.filename().string();
  });
}

std::vector<LeftFreshFile> left_fresh_files_beside(const fs::path& file) {
  const fs::path real = real_file(file);
  const std::string begin = real.stem().string() + ".";
  const std::string end = real.extension().string();
  return left_fresh_files_where(real.parent_path(), [&](const std::string& name) {
    return name.size() >= begin.size() + end.size() && name.starts_with(begin) &&
           name.ends_with(end);
  });
}

LeftContent left_content(const LeftFreshFile& left) {
  std::error_code not_there;
  const std::uintmax_t bytes = fs::file_size(left.path, not_there);
  if (not_there || bytes == 0) return LeftContent::none;
  if (!is_map_file(left.path)) return LeftContent::unfinished;
  try {
    // What is in a log was finished.
    if (fs::exists(beside(left.path, "-wal"), not_there))
      static_cast<void>(open_map_database(left.path));
    SQLite::Database alone(uri_without_log(left.path), SQLite::OPEN_READONLY | SQLite::OPEN_URI);
    if (alone.execAndGet("PRAGMA integrity_check(1)").getString() != "ok")
      return LeftContent::unfinished;
    const bool holds_map = alone
                               .execAndGet(
                                   "SELECT EXISTS (SELECT 1 FROM tiles) OR "
                                   "EXISTS (SELECT 1 FROM trajectory)")
                               .getInt() != 0;
    return holds_map ? LeftContent::whole : LeftContent::none;
  } catch (const std::runtime_error&) {
    return LeftContent::unfinished;
  }
}

bool keep_fresh_file(const LeftFreshFile& left, const fs::path& name) {
  if (!put_in_free_place(left.path, name)) return false;
  remove_fresh_file(left);
  return true;
}

void remove_fresh_file(const LeftFreshFile& left) {
  std::error_code ignored;
  fs::remove_all(left.path.parent_path(), ignored);
}

void remove_useless_fresh_files(const fs::path& file) {
  const bool is_there = is_map_file(real_file(file));
  for (const LeftFreshFile& left : left_fresh_files(file)) {
    const LeftContent content = left_content(left);
    if (content == LeftContent::none || (content == LeftContent::unfinished && is_there))
      remove_fresh_file(left);
  }
}

}  // namespace stillmap
