#include <iostream>
#include <memory>

#include "clients/commands/command.hpp"
#include "clients/commands/traversability/traversability_source.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"

namespace stillmap::cli {
namespace {

Json to_json(const NearestTraversable& nearest, const std::string& profile) {
  Json json = {
      {"profile", profile}, {"status", name(nearest.status)}, {"map_version", nearest.map_version}};
  if (nearest.status != TraversabilityStatus::ok) {
    json.set("reason", nearest.reason);
    return json;
  }
  json.set("position", {nearest.position_map.x(), nearest.position_map.y(), nearest.height_m});
  json.set("distance_m", nearest.distance_m);
  json.set("cost", nearest.cell.cost);
  json.set("inferred", nearest.cell.inferred);
  json.set("clearance_m", nearest.cell.clearance_m);
  return json;
}

std::string describe(const NearestTraversable& nearest, const std::string& profile) {
  if (nearest.status != TraversabilityStatus::ok) return nearest.reason + "\n";
  return "(" + fixed(nearest.position_map.x(), 2) + ", " + fixed(nearest.position_map.y(), 2) +
         ")" + " is free for " + profile + ", " + fixed(nearest.distance_m, 2) +
         " m away; ground at " + fixed(nearest.height_m, 2) + " m" +
         (nearest.cell.inferred ? " (inferred)" : "") + ", cost " +
         std::to_string(nearest.cell.cost) + " of 98, clearance " +
         fixed(nearest.cell.clearance_m, 2) + " m\n";
}

struct NearestArguments {
  TraversabilitySourceArguments source;
  std::vector<double> position_map;
  double max_distance_m = 100.0;
  bool json = false;
};

ExitCode run(const NearestArguments& arguments) {
  end_cleanly_when_stopped();
  const std::unique_ptr<TraversabilitySource> source = open_traversability_source(arguments.source);
  const NearestTraversable nearest = source->nearest(
      {arguments.position_map[0], arguments.position_map[1]}, arguments.max_distance_m);
  require_answer(nearest.status, nearest.reason);
  const std::string profile = source->robot().name;
  std::cout << (arguments.json ? to_json(nearest, profile).dump(2) + "\n"
                               : describe(nearest, profile));
  return nearest.status == TraversabilityStatus::ok ? ExitCode::ok : ExitCode::failed;
}

}  // namespace

void add_nearest_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<NearestArguments>();
  CommandHandle command = program.command("nearest", "The nearest place where a robot can stand");
  add_traversability_source_options(command, arguments->source);
  command.option("--to", arguments->position_map, "x y: the place [m]")
      .exactly(2)
      .comma_separated()
      .required();
  command.option("--max-distance", arguments->max_distance_m, "Search no farther than this [m]")
      .above_zero()
      .with_default();
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap nearest --to 12 -3.5\n"
      "  stillmap nearest city_map/map.stillmap --profile delivery_robot --to 12 -3.5 --json\n"
      "Without MAPFILE, the server is asked. A free cell keeps the robot's inscribed radius from\n"
      "everything lethal; with some heading, the robot can stand there.\n"
      "Exit code 1: there is none so near.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
