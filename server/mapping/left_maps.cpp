#include "server/mapping/left_maps.hpp"

#include <spdlog/spdlog.h>

#include <system_error>

#include "core/map/storage/fresh_map_file.hpp"
#include "core/map/storage/map_file.hpp"
#include "core/map/storage/map_lock.hpp"

namespace stillmap::server {
namespace {

namespace fs = std::filesystem;

constexpr const char* what_to_do_with_part =
    " is a part of a map that a killed server was writing, and may be all that is left of it: keep "
    "it for a repair (sqlite3's .recover), or remove its folder";

constexpr const char* what_to_do_with_unreadable =
    " is what a killed server was writing, and could not be read or given its name (the log says "
    "more); it may be a whole map: see to the disk and the rights, and start the server again";

/// The name that a whole map has from now on.
fs::path keep(const LeftFreshFile& left, const MapFolder& folder) {
  fs::path name = left.name;
  while (!keep_fresh_file(left, name)) name = folder.unused_file_for(left.name);
  spdlog::warn("{} was written by a server that was killed, and is whole: it is {} from now on",
               left.path.string(), name.string());
  return name;
}

std::string listed(const std::vector<fs::path>& files) {
  std::string text;
  for (const fs::path& file : files) text += (text.empty() ? "" : ", ") + file.string();
  return text;
}

void forget_removed(std::vector<fs::path>& files) {
  std::error_code unknown;
  std::erase_if(files,
                [&](const fs::path& file) { return !fs::exists(file, unknown) && !unknown; });
}

}  // namespace

LeftMaps::LeftMaps(const fs::path& file, const MapFolder& folder) {
  const auto look_after = [&](const LeftFreshFile& left) {
    try {
      switch (left_content(left)) {
        case LeftContent::none:
          return remove_fresh_file(left);
        case LeftContent::whole:
          if (const fs::path name = keep(left, folder); name != file) kept_beside_.push_back(name);
          return;
        case LeftContent::unfinished:
          spdlog::warn("{}{}", left.path.string(), what_to_do_with_part);
          return unfinished_.push_back(left.path);
        case LeftContent::unreadable:
          spdlog::error("{} cannot be read", left.path.string());
          break;
      }
    } catch (const std::exception& error) {
      spdlog::error("{} cannot be given a name ({})", left.path.string(), error.what());
    }
    unreadable_.push_back(left.path);
  };
  for (const LeftFreshFile& left : left_fresh_files(file)) look_after(left);
  for (const LeftFreshFile& left : left_fresh_files_beside(file)) {
    try {
      const MapLock lock(left.name);
      look_after(left);
    } catch (const MapFileError& error) {
      // Another server is writing it now.
      spdlog::warn("{} stays as it is: {}", left.path.string(), error.what());
    }
  }
}

void LeftMaps::forget(const fs::path& file) { std::erase(kept_beside_, file); }

std::string LeftMaps::in_words() {
  for (std::vector<fs::path>* files : {&kept_beside_, &unfinished_, &unreadable_})
    forget_removed(*files);
  std::string words;
  if (!kept_beside_.empty()) {
    words = "a server that was killed was saving its map as " + listed(kept_beside_) +
            ", which is whole: 'stillmap load' goes on in it";
  }
  const auto add = [&](const std::vector<fs::path>& files, const char* what_to_do) {
    if (!files.empty()) words += (words.empty() ? "" : "; ") + listed(files) + what_to_do;
  };
  add(unfinished_, what_to_do_with_part);
  add(unreadable_, what_to_do_with_unreadable);
  return words;
}

}  // namespace stillmap::server
