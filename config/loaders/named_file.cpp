#include "config/loaders/named_file.hpp"

#include <cstdlib>
#include <set>

#include "config/loaders/config_error.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> folders(const NamedFilePlaces& places) {
  std::vector<fs::path> folders;
  if (const char* folder = std::getenv(places.variable.c_str())) folders.emplace_back(folder);
  std::error_code none;
  const fs::path program = fs::read_symlink("/proc/self/exe", none);
  if (!program.empty()) {
    folders.push_back(program.parent_path().parent_path() / "share/stillmap" / places.share);
  }
  folders.push_back(places.sources);
  return folders;
}

std::string list_of(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return list;
}

}  // namespace

bool is_file_name(const std::string& name_or_file) {
  return name_or_file.find('/') != std::string::npos || name_or_file.ends_with(".yaml") ||
         name_or_file.ends_with(".yml");
}

std::filesystem::path find_named_file(const NamedFilePlaces& places,
                                      const std::string& name_or_file) {
  if (is_file_name(name_or_file)) return name_or_file;
  for (const fs::path& folder : folders(places)) {
    fs::path file = folder / (name_or_file + ".yaml");
    if (fs::exists(file)) return file;
  }
  std::string text = places.kind;
  text.append(" '").append(name_or_file).append("' is neither known nor a .yaml file; ");
  text.append(places.variable).append(" may name a folder of them; known are: ");
  throw ConfigError({text + list_of(known_names(places))});
}

std::vector<std::string> known_names(const NamedFilePlaces& places) {
  std::set<std::string> names;
  for (const fs::path& folder : folders(places)) {
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(folder, none)) {
      if (entry.path().extension() == ".yaml") names.insert(entry.path().stem().string());
    }
  }
  return {names.begin(), names.end()};
}

}  // namespace stillmap
