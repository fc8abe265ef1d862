#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "clients/commands/command.hpp"
#include "clients/commands/map_files/map_diff_report.hpp"
#include "core/map/storage/map_file_copy.hpp"
#include "core/picture/map_change_picture.hpp"

namespace stillmap::cli {
namespace {

struct Arguments {
  std::string before;
  std::string after;
  MapDiffOptions options;
  std::string picture;
  bool json = false;
};

ExitCode run(const Arguments& arguments) {
  const MapSnapshot before = read_map_file(arguments.before).view;
  const MapSnapshot after = read_map_file(arguments.after).view;
  const MapDiff diff = diff_maps(before, after, arguments.options);
  if (!arguments.picture.empty()) write_diff_picture(arguments.picture, before, after, diff);
  std::cout << (arguments.json ? to_json(diff).dump(2) + "\n" : describe(diff));
  return ExitCode::ok;
}

}  // namespace

void add_map_diff_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command =
      program.command("map-diff", "Say what changed between two map files of one place, by class");
  command.option("BEFORE", arguments->before, "The earlier map").required();
  command.option("AFTER", arguments->after, "The later map, in the same frame").required();
  command
      .option("--tolerance", arguments->options.tolerance_voxels,
              "A voxel is gone, or new, only when the other map has none so many cells away")
      .between(0, MapDiffOptions::max_tolerance_voxels)
      .with_default();
  command.option("--picture", arguments->picture,
                 "Draw it from above, to FILE.png: appeared green, gone red, another class yellow");
  command.flag("--json", arguments->json, "Print JSON, with all tiles");
  command.explain(
      "Examples:\n"
      "  stillmap map-diff monday.stillmap tuesday.stillmap --picture changes.png\n"
      "  stillmap map-diff a.stillmap b.stillmap --tolerance 0 --json | jq .classes\n"
      "The maps must lie in one frame: the later one was mapped on in a copy of the earlier, or\n"
      "both began at the same place. Voxels must have one size.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
