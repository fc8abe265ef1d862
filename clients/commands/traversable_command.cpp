#include <chrono>
#include <filesystem>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "clients/commands/command.hpp"
#include "clients/commands/traversable_report.hpp"
#include "config/robot_profile.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/map/map_file.hpp"
#include "core/traversability/nav2_map.hpp"
#include "core/traversability/traversability_picture.hpp"

namespace stillmap {
namespace {

struct Arguments {
  std::string map;
  std::string profile = "car";
  std::string out;
  std::string picture;
  bool json = false;
};

TraversableReport update(TraversabilityMap& area, const MapView& map) {
  const auto start = std::chrono::steady_clock::now();
  TraversableReport report;
  report.work = area.update(map);
  report.milliseconds =
      std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - start).count();
  return report;
}

ExitCode run(const Arguments& arguments) {
  const RobotProfile profile = load_robot_profile(arguments.profile);
  if (!std::filesystem::exists(arguments.map)) {
    throw DatasetError(arguments.map, "does not exist; 'stillmap map' writes map files");
  }
  const StoredMap map = open_map_file(arguments.map)->load();
  TraversabilityMap area({profile});
  TraversableReport report = update(area, map.view);
  const TraversabilityView& view = *area.view(profile.name);
  report.summary = summarize(view);
  if (!arguments.out.empty()) write_nav2_map(arguments.out, occupancy_grid(view, everywhere()));
  if (!arguments.picture.empty()) {
    TraversabilityPictureOptions options;
    options.trajectory = map.trajectory;
    write_traversability_picture(arguments.picture, view, options);
  }
  std::cout << (arguments.json ? to_json(view, report).dump(2) + "\n" : describe(view, report));
  return ExitCode::ok;
}

}  // namespace

void add_traversable_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command = program.command(
      "traversable", "Where a robot can drive on a stored map, and why not elsewhere");
  command.option("MAPFILE", arguments->map, "Map file (map.stillmap of 'stillmap map')").required();
  command
      .option("--profile", arguments->profile,
              "The robot: car, delivery_robot, tracked, or a file like config/robots/car.yaml")
      .with_default();
  command.option("--out", arguments->out,
                 "Folder for Nav2's map_server: map.yaml and map.pgm; made if need be");
  command.option("--picture", arguments->picture, "Draw the area and its reasons to FILE.png");
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap traversable city_map/map.stillmap --picture car.png\n"
      "  stillmap traversable city_map/map.stillmap --profile delivery_robot --out nav2\n"
      "  stillmap traversable city_map/map.stillmap --profile my_robot.yaml --json\n"
      "A cell is free, lethal for a reason (obstacle, low head-room, step, slope, roughness,\n"
      "class, or inflation: too near to such a cell), or unknown. 'Inferred' ground was not seen\n"
      "and follows from what lies around: between the lidar's rings, under removed cars.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap
