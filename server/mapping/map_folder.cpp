#include "server/mapping/map_folder.hpp"

#include <algorithm>
#include <array>
#include <chrono>
#include <ctime>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include "core/map/storage/map_file.hpp"

namespace stillmap::server {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t max_name_bytes = 200;

/// Of the files that stand beside a map file while it is used.
constexpr std::array<std::string_view, 5> reserved_endings{"-wal", "-shm", "-journal", ".lock",
                                                           ".other"};

/// What is wrong with a name that is no path, and nothing that SQLite, a shell or another system
/// would read as more than a name; empty for a plain one.
std::string fault_of_name(const std::string& name) {
  const auto is_special = [](unsigned char c) {
    return c < ' ' || c == 127 ||
           std::string_view("/\\:?*%\"<>|").find(static_cast<char>(c)) != std::string_view::npos;
  };
  const auto ends_as = [&](std::string_view ending) { return name.ends_with(ending); };
  if (name.empty() || name.front() == '.' || name.front() == '-' || name.front() == ' ' ||
      name.back() == ' ' || std::ranges::any_of(name, is_special)) {
    return "must be a plain name, without any of / \\ : ? * % \" < > | not beginning with . or -, "
           "and with no space at either end; it is looked for beside the configured map file";
  }
  if (name.size() > max_name_bytes) {
    return "has " + std::to_string(name.size()) + " bytes; choose a plain name of " +
           std::to_string(max_name_bytes) + " at most";
  }
  const auto ending = std::ranges::find_if(reserved_endings, ends_as);
  if (ending == reserved_endings.end()) return {};
  return "ends in " + std::string(*ending) +
         ", as files do that stand beside a map file while it is used; choose another plain name";
}

std::string local_time() {
  const std::time_t now = std::chrono::system_clock::to_time_t(std::chrono::system_clock::now());
  std::tm parts{};
  ::localtime_r(&now, &parts);
  std::array<char, 32> text{};
  std::strftime(text.data(), text.size(), "%Y-%m-%d_%H%M%S", &parts);
  return text.data();
}

}  // namespace

MapFolder::MapFolder(const fs::path& map_file, const SavedMapsLimit& limit)
    : folder_(fs::absolute(map_file.empty() ? fs::path("map") : map_file).parent_path()),
      limit_(limit) {}

fs::path MapFolder::file_named(const std::string& name) const {
  if (const std::string fault = fault_of_name(name); !fault.empty())
    throw std::invalid_argument("file '" + name + "' " + fault);
  const fs::path file = folder_ / name;
  std::error_code error;
  if (real_file(file).parent_path() != fs::weakly_canonical(folder_, error)) {
    throw std::invalid_argument("file '" + name + "' is a link that leads out of " +
                                folder_.string() + "; it must be a plain name of a file there");
  }
  return file;
}

fs::path MapFolder::unused_file_for(const fs::path& map_file) const {
  const std::string stem = map_file.stem().string() + "." + local_time();
  const std::string extension = map_file.extension().string();
  fs::path file = folder_ / (stem + extension);
  std::error_code fault;
  for (int n = 2; fs::exists(file, fault); ++n) {
    file = folder_ / (stem + "." + std::to_string(n) + extension);
  }
  if (fault) throw MapFileError(file, "cannot be made (" + fault.message() + ")");
  return file;
}

void MapFolder::check_room(const fs::path& running, const fs::path& replaced,
                           std::uintmax_t bytes) const {
  std::uintmax_t maps = 1;
  std::error_code error;
  for (fs::directory_iterator entry(folder_, error); !error && entry != fs::directory_iterator();
       entry.increment(error)) {
    const fs::path& file = entry->path();
    std::error_code unknown;
    // Opening the running map's file and closing it again would release SQLite's locks on it. It
    // may have other names.
    const bool is_running = fs::equivalent(file, running, unknown);
    if (is_running || fs::equivalent(file, replaced, unknown) || !is_map_file(file)) continue;
    ++maps;
    const std::uintmax_t size = entry->file_size(unknown);
    if (!unknown) bytes += size;
  }
  if (maps <= limit_.max_maps && bytes <= limit_.max_bytes) return;
  throw RefusedNow("with it, there would be " + std::to_string(maps) + " saved maps of " +
                   std::to_string(bytes >> 20) + " MiB in " + folder_.string() +
                   ", and the limits are " + std::to_string(limit_.max_maps) +
                   " (map.saved_maps) and " + std::to_string(limit_.max_bytes >> 20) +
                   " MiB (map.saved_maps_mib): remove some there, or raise the limits");
}

}  // namespace stillmap::server
