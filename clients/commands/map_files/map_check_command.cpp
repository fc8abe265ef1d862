#include <iostream>
#include <memory>
#include <optional>

#include "clients/commands/command.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "core/map/tools/map_check.hpp"

namespace stillmap::cli {
namespace {

struct MapCheckArguments {
  std::string file;
  bool json = false;
};

MapCheck check_with_progress(const std::string& file) {
  std::optional<Progress> progress;
  return check_map_file(file, [&](std::size_t done, std::size_t total) {
    if (!progress) progress.emplace("check", "tiles", total);
    progress->update(done);
  });
}

Json fault_json(const MapFault& fault) {
  Json json{{"place", fault.place}, {"what", fault.what}};
  if (fault.tile) json.set("tile", {fault.tile->x, fault.tile->y});
  return json;
}

Json to_json(const MapCheck& check) {
  Json faults = Json::array();
  for (const MapFault& fault : check.faults) faults.push_back(fault_json(fault));
  return {{"valid", check.is_sound()},
          {"tiles", check.tiles},
          {"valid_tiles", check.sound_tiles},
          {"voxels", check.voxels},
          {"hidden_voxels", check.hidden_voxels},
          {"poses", check.poses},
          {"sessions", check.sessions},
          {"faults", faults}};
}

std::string describe(const MapFault& fault) {
  std::string text = fault.place;
  if (fault.tile) {
    text += " (" + std::to_string(fault.tile->x) + ", " + std::to_string(fault.tile->y) + ")";
  }
  return text + (fault.tile ? " " : ": ") + fault.what;
}

std::string describe(const MapCheck& check) {
  std::string text;
  for (const MapFault& fault : check.faults) text += describe(fault) + "\n";
  const std::string looked_at =
      std::to_string(check.tiles) + " tiles, " + std::to_string(check.voxels) + " voxels, " +
      std::to_string(check.poses) + " poses of " + std::to_string(check.sessions) +
      (check.sessions == 1 ? " session" : " sessions");
  if (check.is_sound()) return "valid: " + looked_at + "\n";
  return text + "damaged: " + std::to_string(check.faults.size()) + " faults in " + looked_at +
         "; " + std::to_string(check.sound_tiles) +
         " tiles are valid. Restore a copy, or map again.\n";
}

ExitCode run(const MapCheckArguments& arguments) {
  end_cleanly_when_stopped();
  const MapCheck check = check_with_progress(arguments.file);
  std::cout << (arguments.json ? to_json(check).dump(2) + "\n" : describe(check));
  return check.is_sound() ? ExitCode::ok : ExitCode::failed;
}

}  // namespace

void add_map_check_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<MapCheckArguments>();
  CommandHandle command =
      program.command("map-check", "Verify a map file: its database, every tile's hash, the path");
  command.option("FILE,--map", arguments->file, "A map file; it is only read").required();
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap map-check city.stillmap\n"
      "  stillmap map-check backup.stillmap --json | jq '.faults[] | select(.tile)'\n"
      "Exit code 0: valid; 1: damaged, each fault is named with its tile; 2: no map file that this "
      "version can read.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
