// A whole map file: an SQLite database.

#include "core/map/storage/shown_map.hpp"
#include "core/map/tools/map_check.hpp"
#include "core/map/tools/map_info.hpp"
#include "tests/fuzz/byte_source.hpp"
#include "tests/fuzz/loaded_map.hpp"
#include "tests/fuzz/memory_folder.hpp"
#include "tests/fuzz/street_map.hpp"

namespace stillmap::fuzz {
// A namespace of its own: every target has helpers of the same names.
namespace map_file_inputs {
namespace {

/// As `stillmap map check` and `map info` read it: the file stays as it is.
void look_at(const std::filesystem::path& file) {
  try {
    static_cast<void>(check_map_file(file));
    static_cast<void>(map_file_info(file));
  } catch (const MapFileError&) {
  }
}

/// As Python reads it, in place.
void show(const std::filesystem::path& file) {
  try {
    static_cast<void>(read_shown_map(file).read_evidence());
  } catch (const MapFileError&) {
  }
}

void run(Bytes bytes) {
  const auto& folder = MemoryFolder::of_this_process();
  folder.remove("map.stillmap");
  const auto file = folder.file("map.stillmap", bytes);
  look_at(file);
  show(file);
  load_and_resume_map(file);
}

std::vector<Seed> seeds() {
  const auto& folder = MemoryFolder::of_this_process();
  folder.remove("seed.stillmap");
  const auto file = folder.path("seed.stillmap");
  open_map_file(file)->save(small_street());
  std::vector<Seed> all{{"street", content_of(file)}};
  folder.remove("seed.stillmap");
  static_cast<void>(open_map_file(file));
  all.push_back({"no_map", content_of(file)});
  return all;
}

}  // namespace
}  // namespace map_file_inputs

const Target map_file_target{"map_file", map_file_inputs::run, map_file_inputs::seeds};

}  // namespace stillmap::fuzz
