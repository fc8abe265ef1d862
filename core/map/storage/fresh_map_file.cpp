#include "core/map/storage/fresh_map_file.hpp"

#include <string>
#include <system_error>
#include <vector>

#include "core/map/storage/map_database.hpp"
#include "core/map/storage/map_file.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

constexpr const char* folder_suffix = ".new-";
constexpr std::size_t letters_of_folder = 6;
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

}  // namespace

FreshMapFile::FreshMapFile(const fs::path& file)
    : folder_(beside(real_file(file), folder_suffix)), path_(folder_.path() / name_in_folder) {}

void remove_left_fresh_files(const fs::path& file) {
  const fs::path real = real_file(file);
  const std::string prefix = beside(real.filename(), folder_suffix).string();
  for (const fs::path& entry : entries_of(real.parent_path())) {
    const std::string name = entry.filename().string();
    if (name.size() != prefix.size() + letters_of_folder || !name.starts_with(prefix)) continue;
    std::error_code ignored;
    if (is_of_fresh_file(entry)) fs::remove_all(entry, ignored);
  }
}

std::vector<fs::path> fresh_files_beside(const fs::path& file) {
  const fs::path real = real_file(file);
  const std::string begin = real.stem().string() + ".";
  const std::string end = beside(real.extension(), folder_suffix).string();
  std::vector<fs::path> files;
  for (const fs::path& entry : entries_of(real.parent_path())) {
    std::string name = entry.filename().string();
    if (name.size() < begin.size() + end.size() + letters_of_folder) continue;
    name.resize(name.size() - letters_of_folder);
    std::error_code error;
    const fs::path fresh = entry / name_in_folder;
    if (name.starts_with(begin) && name.ends_with(end) && is_of_fresh_file(entry) &&
        fs::exists(fresh, error))
      files.push_back(fresh);
  }
  return files;
}

}  // namespace stillmap
