#include "config/loaders/named_file.hpp"

#include <cstdlib>
#include <set>

#include "config/loaders/config_error.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> folders(const NamedFileSearchPaths& search_paths) {
  std::vector<fs::path> folders;
  if (const char* folder = std::getenv(search_paths.variable.c_str())) folders.emplace_back(folder);
  std::error_code none;
  const fs::path program = fs::read_symlink("/proc/self/exe", none);
  if (!program.empty()) {
    folders.push_back(program.parent_path().parent_path() / "share/stillmap" / search_paths.share);
  }
  folders.push_back(search_paths.sources);
  return folders;
}

std::string list_of(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return list;
}

/// Names that are found without a folder, sorted.
std::vector<std::string> known_names(const NamedFileSearchPaths& search_paths) {
  std::set<std::string> names;
  for (const fs::path& folder : folders(search_paths)) {
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(folder, none)) {
      if (entry.path().extension() == ".yaml") names.insert(entry.path().stem().string());
    }
  }
  return {names.begin(), names.end()};
}

}  // namespace

bool is_file_name(const std::string& name_or_file) {
  return name_or_file.find('/') != std::string::npos || name_or_file.ends_with(".yaml") ||
         name_or_file.ends_with(".yml");
}

std::filesystem::path find_named_file(const NamedFileSearchPaths& search_paths,
                                      const std::string& name_or_file) {
  if (is_file_name(name_or_file)) return name_or_file;
  for (const fs::path& folder : folders(search_paths)) {
    fs::path file = folder / (name_or_file + ".yaml");
    if (fs::exists(file)) return file;
  }
  std::string text = search_paths.kind;
  text.append(" '").append(name_or_file).append("' is neither known nor a .yaml file; ");
  text.append(search_paths.variable).append(" may name a folder of them; known are: ");
  throw ConfigError({text + list_of(known_names(search_paths))});
}

}  // namespace stillmap
