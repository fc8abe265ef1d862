#include <iostream>
#include <memory>
#include <stdexcept>

#include "clients/commands/command.hpp"
#include "clients/commands/pose_report.hpp"
#include "clients/commands/query/region_arguments.hpp"
#include "clients/commands/traversability/traversability_source.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"

namespace stillmap::cli {
namespace {

std::string at(const Eigen::Vector2d& position_map) {
  std::string text = "(";
  return text.append(fixed(position_map.x(), 2))
      .append(", ")
      .append(fixed(position_map.y(), 2))
      .append(")");
}

Json conflict_json(const PathConflict& conflict) {
  return {{"segment", conflict.segment},
          {"along_m", conflict.along_m},
          {"pose",
           {{"x", conflict.pose.position_map.x()},
            {"y", conflict.pose.position_map.y()},
            {"heading_rad", conflict.pose.heading_rad}}},
          {"place", {conflict.cell_centre_map.x(), conflict.cell_centre_map.y()}},
          {"reason", name(conflict.reason)}};
}

std::string inferred_part(double inferred_m) {
  if (inferred_m == 0.0) return {};
  std::string text = ", ";
  return text.append(fixed(inferred_m, 1)).append(" m of it on inferred ground");
}

Json to_json(const PathCheck& check, const std::string& profile) {
  Json json = {{"profile", profile},
               {"status", name(check.status)},
               {"free", check.is_free},
               {"clearance_m", check.clearance_m},
               {"checked_m", check.checked_m},
               {"inferred_m", check.inferred_m},
               {"map_version", check.map_version}};
  if (!check.reason.empty()) json.set("reason", check.reason);
  if (check.conflict) json.set("conflict", conflict_json(*check.conflict));
  return json;
}

std::string describe(const PathCheck& check, const std::string& profile) {
  if (check.status != TraversabilityStatus::ok) return "not known: " + check.reason + "\n";
  if (!check.conflict) {
    return "free for " + profile + ": " + fixed(check.checked_m, 1) + " m, clearance " +
           fixed(check.clearance_m, 2) + " m" + inferred_part(check.inferred_m) + "\n";
  }
  const PathConflict& conflict = *check.conflict;
  return "blocked for " + profile + " after " + fixed(conflict.along_m, 1) +
         " m: " + std::string(name(conflict.reason)) + " at " + at(conflict.cell_centre_map) +
         ", touched by the robot at " + at(conflict.pose.position_map) + " with heading " +
         fixed(heading_deg(conflict.pose), 0) + " degrees, after position " +
         std::to_string(conflict.segment) + "\n";
}

struct CheckPathArguments {
  TraversabilitySourceArguments source;
  std::vector<std::string> path;
  std::vector<double> headings_rad;
  bool json = false;
};

ExitCode run(const CheckPathArguments& arguments) {
  end_cleanly_when_stopped();
  PathQuery query;
  query.positions_map = parse_points_2d("--path", arguments.path);
  query.headings_rad = arguments.headings_rad;
  const std::unique_ptr<TraversabilitySource> source = open_traversability_source(arguments.source);
  const PathCheck check = source->check(query);
  require_answer(check.status, check.reason);
  const std::string profile = source->robot().name;
  std::cout << (arguments.json ? to_json(check, profile).dump(2) + "\n" : describe(check, profile));
  return check.is_free ? ExitCode::ok : ExitCode::failed;
}

}  // namespace

void add_check_path_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<CheckPathArguments>();
  CommandHandle command =
      program.command("check-path", "Whether a robot can follow a path, or what is in its way");
  add_traversability_source_options(command, arguments->source);
  command
      .option("--path", arguments->path,
              "x y x y ...: positions [m]; or FILE with a position a line")
      .required();
  command
      .option("--headings", arguments->headings_rad,
              "One a position [rad], from x towards y; without, the robot drives straight from "
              "position to position and turns on the spot")
      .comma_separated();
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap check-path --path 0 0 12 0.5 20 4\n"
      "  stillmap check-path --profile delivery_robot --path way.txt --json\n"
      "  stillmap check-path city_map/map.stillmap --path 0 0 --headings 1.57\n"
      "Without MAPFILE, the server is asked. The robot's oriented footprint is moved along the\n"
      "path; the first cell that it must not touch is named with its place and reason.\n"
      "Exit code 0: free; 1: blocked, or nothing is mapped there yet.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
