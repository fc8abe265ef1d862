#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "clients/commands/command.hpp"
#include "clients/commands/map_files/map_info_report.hpp"

namespace stillmap::cli {
namespace {

struct Arguments {
  std::string file;
  bool json = false;
};

ExitCode run(const Arguments& arguments) {
  const MapFileInfo info = map_file_info(arguments.file);
  std::cout << (arguments.json ? to_json(info).dump(2) + "\n" : describe(info));
  return ExitCode::ok;
}

}  // namespace

void add_map_info_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command =
      program.command("map-info", "Say what a map file holds: sizes, classes, bounds, path, times");
  command.option("FILE", arguments->file, "A map file; it is only read").required();
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap map-info city_map/map.stillmap\n"
      "  stillmap map-info city.stillmap --json | jq .classes\n"
      "A server may be mapping in the file: this shows its last save.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
