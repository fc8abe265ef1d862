#include "core/dataset/plugin.hpp"

#include <dlfcn.h>

#include <filesystem>
#include <vector>

namespace stillmap {
namespace {

namespace fs = std::filesystem;

/// A program is in bin/ of an installation or a build, a test two folders below the build.
std::vector<fs::path> places_of(const std::string& library) {
  std::vector<fs::path> places;
  std::error_code none;
  const fs::path program = fs::read_symlink("/proc/self/exe", none);
  for (fs::path root = program.parent_path(); places.size() < 3; root = root.parent_path()) {
    places.push_back(root.parent_path() / STILLMAP_PLUGIN_FOLDER / library);
  }
  return places;
}

void* open_library(const std::string& library) {
  for (const fs::path& place : places_of(library)) {
    std::error_code none;
    if (fs::exists(place, none)) return dlopen(place.c_str(), RTLD_NOW | RTLD_LOCAL);
  }
  return dlopen(library.c_str(), RTLD_NOW | RTLD_LOCAL);
}

}  // namespace

void* plugin_symbol(const std::string& part, const std::string& function,
                    const std::string& purpose) {
  const std::string name = "stillmap_" + part + ".so";
  // Loading again what is loaded only counts it; it is never given back.
  void* const library = open_library(name);
  void* const address = library == nullptr ? nullptr : dlsym(library, function.c_str());
  if (address != nullptr) return address;
  const char* const fault = dlerror();
  throw MissingPlugin(purpose + " by " + name + ", which cannot be loaded (" +
                      (fault == nullptr ? "reason unknown" : fault) +
                      "); it comes in the package stillmap-formats");
}

}  // namespace stillmap
