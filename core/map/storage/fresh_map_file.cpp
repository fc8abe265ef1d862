#include "core/map/storage/fresh_map_file.hpp"

#include <SQLiteCpp/Database.h>
#include <sqlite3.h>

#include <algorithm>
#include <exception>
#include <fstream>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "core/map/storage/map_database.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/map/storage/save_marks.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

constexpr const char* folder_suffix = ".new-";
/// With the six letters after it.
constexpr std::size_t ending_of_folder = 11;
constexpr const char* name_in_folder = "unfinished.stillmap";
/// Of one that is changed after it was written whole.
constexpr const char* name_in_steps = "in_steps.stillmap";
/// As the time in the name of a map that is kept beside another one.
constexpr std::string_view form_of_time = "dddd-dd-dd_dddddd";

/// `error`: what kept it from being read to its end.
std::vector<fs::path> entries_of(const fs::path& folder, std::error_code& error) {
  std::vector<fs::path> entries;
  for (fs::directory_iterator entry(folder, error); !error && entry != fs::directory_iterator();
       entry.increment(error)) {
    entries.push_back(entry->path());
  }
  return entries;
}

/// Whether this is the name of the database or of what SQLite puts beside it.
bool is_of_database(const fs::path& entry, const char* database) {
  for (const char* suffix : {"", "-wal", "-shm", "-journal"}) {
    if (entry.filename() == std::string(database) + suffix) return true;
  }
  return false;
}

/// Whether a process was killed while it made, in a fresh folder of its own, the map that is then
/// changed in steps.
bool is_first_step(const fs::path& entry) {
  std::error_code error;
  const std::string name = entry.filename().string();
  const std::string begin = std::string(name_in_steps) + folder_suffix;
  const bool is_named_so = name.starts_with(begin) &&
                           name.size() == std::string_view(name_in_steps).size() + ending_of_folder;
  if (!is_named_so || fs::symlink_status(entry, error).type() != fs::file_type::directory)
    return false;
  const std::vector<fs::path> entries = entries_of(entry, error);
  return !error && std::ranges::all_of(entries, [](const fs::path& each) {
    return is_of_database(each, name_in_folder);
  });
}

/// The fresh map file of this folder, which may not be there yet; nothing where the folder has
/// anything else in it, such as what somebody repaired: that is no process's to remove.
std::optional<fs::path> fresh_file_of(const fs::path& folder) {
  std::error_code error;
  if (fs::symlink_status(folder, error).type() != fs::file_type::directory) return std::nullopt;
  const std::vector<fs::path> entries = entries_of(folder, error);
  if (std::ranges::all_of(entries,
                          [](const auto& each) { return is_of_database(each, name_in_folder); }))
    return folder / name_in_folder;
  if (std::ranges::all_of(entries, [](const auto& each) {
        return is_of_database(each, name_in_steps) || is_first_step(each);
      }))
    return folder / name_in_steps;
  return std::nullopt;
}

/// A time, or a time and ".2", ".3", ...
bool is_time(std::string_view text) {
  const auto is_digit = [](char c) { return c >= '0' && c <= '9'; };
  if (text.size() < form_of_time.size()) return false;
  const std::string_view number = text.substr(form_of_time.size());
  const bool is_alike =
      std::ranges::equal(text.substr(0, form_of_time.size()), form_of_time,
                         [&](char c, char form) { return form == 'd' ? is_digit(c) : c == form; });
  return is_alike && (number.empty() || (number.size() > 1 && number.front() == '.' &&
                                         std::ranges::all_of(number.substr(1), is_digit)));
}

/// is_of_content() of the first fault that a check of all pages tells.
bool is_told_of_content(const std::string& told) {
  constexpr std::string_view page_not_read = "error code=";
  const std::size_t begin = told.find(page_not_read);
  return begin == std::string::npos ||
         told.substr(begin + page_not_read.size()).starts_with(std::to_string(SQLITE_CORRUPT));
}

/// Whether nothing has this name; false where that cannot be found out.
bool is_absent(const std::error_code& error) {
  return error == std::errc::no_such_file_or_directory || error == std::errc::not_a_directory;
}

/// Throws MapFileError, SQLite::Exception.
LeftContent content_of_map(const fs::path& file) {
  std::error_code unknown;
  // What is in a log was finished.
  if (fs::exists(beside(file, "-wal"), unknown)) static_cast<void>(open_map_database(file));
  SQLite::Database alone(uri_without_log(file), SQLite::OPEN_READONLY | SQLite::OPEN_URI);
  const std::string told = alone.execAndGet("PRAGMA integrity_check(1)").getString();
  if (told != "ok")
    return is_told_of_content(told) ? LeftContent::unfinished : LeftContent::unreadable;
  const bool holds_map = alone
                             .execAndGet(
                                 "SELECT EXISTS (SELECT 1 FROM tiles) OR "
                                 "EXISTS (SELECT 1 FROM trajectory)")
                             .getInt() != 0;
  return holds_map ? LeftContent::whole : LeftContent::none;
}

/// In this folder, of files whose name is one of those; the newest first.
std::vector<LeftFreshFile> left_fresh_files_where(
    const fs::path& folder, const std::function<bool(const std::string& name)>& is_wanted) {
  std::vector<std::pair<fs::file_time_type, LeftFreshFile>> found;
  std::error_code unknown;
  for (const fs::path& entry : entries_of(folder, unknown)) {
    std::string name = entry.filename().string();
    const std::size_t end = name.rfind(folder_suffix);
    if (end == std::string::npos || name.size() - end != ending_of_folder) continue;
    name.resize(end);
    if (!is_wanted(name)) continue;
    const std::optional<fs::path> fresh = fresh_file_of(entry);
    if (fresh) found.push_back({fs::last_write_time(*fresh, unknown), {*fresh, folder / name}});
  }
  std::ranges::stable_sort(found, std::ranges::greater(),
                           [](const auto& each) { return each.first; });
  std::vector<LeftFreshFile> files;
  for (auto& [written, left] : found) files.push_back(std::move(left));
  return files;
}

}  // namespace

FreshMapFile::FreshMapFile(const fs::path& file, Writing writing)
    : folder_(beside(real_file(file), folder_suffix)),
      path_(folder_.path() / (writing == Writing::in_steps ? name_in_steps : name_in_folder)) {}

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
    if (name.size() < begin.size() + end.size()) return false;
    // "city.north.stillmap" beside "city.stillmap" is another map's name.
    return name.starts_with(begin) && name.ends_with(end) &&
           is_time(std::string_view(name).substr(begin.size(),
                                                 name.size() - begin.size() - end.size()));
  });
}

LeftContent left_content(const LeftFreshFile& left) {
  std::error_code fault;
  static_cast<void>(entries_of(left.path.parent_path(), fault));
  if (fault) return LeftContent::unreadable;
  if (left.path.filename() == name_in_steps) return LeftContent::none;
  const std::uintmax_t bytes = fs::file_size(left.path, fault);
  if (fault) return is_absent(fault) ? LeftContent::none : LeftContent::unreadable;
  if (bytes == 0) return LeftContent::none;
  if (!std::ifstream(left.path)) return LeftContent::unreadable;
  if (!is_map_file(left.path)) return LeftContent::unfinished;
  try {
    return content_of_map(left.path);
  } catch (const UnusableMapFileError&) {
    return LeftContent::unfinished;
  } catch (const SQLite::Exception& error) {
    return is_of_content(error) ? LeftContent::unfinished : LeftContent::unreadable;
  } catch (const std::exception&) {
    return LeftContent::unreadable;
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
