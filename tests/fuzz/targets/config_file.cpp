// A number that says which kind of file, then its YAML: server, sensor, robot.

#include "config/loaders/robot_profile.hpp"
#include "config/loaders/sensor_file.hpp"
#include "config/loaders/server_config.hpp"
#include "core/occupancy/occupancy_map.hpp"
#include "tests/fuzz/byte_source.hpp"
#include "tests/fuzz/invariant.hpp"
#include "tests/fuzz/memory_folder.hpp"

namespace stillmap::fuzz {
// A namespace of its own: every target has helpers of the same names.
namespace config_file_inputs {
namespace {

namespace fs = std::filesystem;

enum Kind : std::uint8_t { server, sensor, robot, kinds };

/// What the server makes of its configuration before it opens anything.
void read_server(const fs::path& file) {
  const ServerConfig config = load_server_config(file);
  require(config.mapper.static_map.faults().empty(), "a map can be made");
  require(config.occupancy.map.faults().empty(), "an octree can be made");
  static_cast<void>(load_robots(config.traversability));
}

void read(Kind kind, const fs::path& file) {
  if (kind == server) read_server(file);
  if (kind == sensor) static_cast<void>(load_sensor(file.string()));
  if (kind == robot) {
    require(read_robot_profile(file).faults().empty(), "a robot that was read can be used");
  }
}

void run(Bytes bytes) {
  ByteSource source(bytes);
  const auto kind = static_cast<Kind>(source.byte() % kinds);
  const auto file = MemoryFolder::of_this_process().file("file.yaml", source.rest());
  try {
    read(kind, file);
  } catch (const ConfigError& error) {
    require(!error.faults().empty(), "a refusal says why");
  }
}

void add_files(Kind kind, const char* folder, std::vector<Seed>& all) {
  for (const auto& entry : fs::directory_iterator(fs::path(STILLMAP_CONFIG_FOLDER) / folder)) {
    if (entry.path().extension() != ".yaml") continue;
    all.push_back({entry.path().stem().string(), with_choice(kind, content_of(entry.path()))});
  }
}

std::vector<Seed> seeds() {
  std::vector<Seed> all;
  add_files(server, "server", all);
  add_files(sensor, "sensors", all);
  add_files(robot, "robots", all);
  return all;
}

}  // namespace
}  // namespace config_file_inputs

const Target config_file_target{"config_file", config_file_inputs::run, config_file_inputs::seeds};

}  // namespace stillmap::fuzz
