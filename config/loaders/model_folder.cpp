#include "config/loaders/model_folder.hpp"

#include <cstdlib>
#include <map>
#include <string>
#include <vector>

#include "config/loaders/config_error.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> model_search_paths() {
  std::vector<fs::path> places;
  if (const char* folder = std::getenv("STILLMAP_MODELS")) places.emplace_back(folder);
  std::error_code none;
  const fs::path program = fs::read_symlink("/proc/self/exe", none);
  if (!program.empty()) {
    places.push_back(program.parent_path().parent_path() / "share/stillmap/models");
  }
  places.emplace_back(STILLMAP_MODEL_SOURCES);
  return places;
}

}  // namespace

fs::path find_model(const fs::path& model) {
  // A data set's folder may have a model's name.
  if (model.has_parent_path() || fs::exists(model / "model.yaml")) return model;
  std::string tried;
  for (const fs::path& place : model_search_paths()) {
    if (fs::exists(place / model / "model.yaml")) return place / model;
    tried.append("\n  ").append(place.string());
  }
  if (fs::is_directory(model)) return model;
  throw ConfigError({"model '" + model.string() +
                     "' is not known; give a model's folder, or set STILLMAP_MODELS to the folder "
                     "that holds it. Looked in:" +
                     tried});
}

std::vector<fs::path> known_models() {
  std::map<std::string, fs::path> folder_of_name;
  for (const fs::path& place : model_search_paths()) {
    std::error_code none;
    for (const auto& entry : fs::directory_iterator(place, none)) {
      if (fs::exists(entry.path() / "model.yaml", none))
        folder_of_name.try_emplace(entry.path().filename().string(), entry.path());
    }
  }
  std::vector<fs::path> folders;
  for (const auto& [name, folder] : folder_of_name) folders.push_back(folder);
  return folders;
}

}  // namespace stillmap
