#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/pose_report.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/table.hpp"
#include "core/lidar/angle_units.hpp"

namespace stillmap::cli {
namespace {

struct LocateArguments {
  ClientArguments client;
  /// x, y [m], heading [degrees].
  std::vector<double> near;
  double radius_m = 20.0;
  double max_turn_deg = 180.0;
  bool apply = false;
  bool json = false;
};

LocalizationQuestion question_of(const LocateArguments& arguments) {
  LocalizationQuestion question{.guess = std::nullopt, .apply = arguments.apply};
  if (arguments.near.empty()) return question;
  question.guess = PlaceGuess{
      .T_map_base = Eigen::Translation3d(arguments.near[0], arguments.near[1], 0.0) *
                    Eigen::AngleAxisd(arguments.near[2] * rad_per_deg, Eigen::Vector3d::UnitZ()),
      .radius_m = arguments.radius_m,
      .max_turn_rad = arguments.max_turn_deg * rad_per_deg};
  return question;
}

Json to_json(const LocalizationAnswer& answer) {
  const bool is_found = answer.outcome == LocalizationStatus::found;
  return {{"outcome", name(answer.outcome)},
          {"stamp_ns", answer.stamp_ns},
          {"pose", is_found ? pose_json(answer.T_map_base) : Json(nullptr)},
          {"score", answer.score},
          {"runner_up_score", answer.runner_up_score},
          {"ms", answer.milliseconds},
          {"applied", answer.applied}};
}

std::string describe(const LocalizationAnswer& answer) {
  std::string text(name(answer.outcome));
  if (answer.outcome == LocalizationStatus::found) {
    const Eigen::Vector3d p = answer.T_map_base.translation();
    text += ": the robot is at " + fixed(p.x(), 2) + " " + fixed(p.y(), 2) + " " + fixed(p.z(), 2) +
            ", heading " + fixed(heading_deg(answer.T_map_base), 1) + " degrees";
  }
  text += "; score " + fixed(answer.score, 2) + ", next best place " +
          fixed(answer.runner_up_score, 2) + ", " + fixed(answer.milliseconds, 0) + " ms";
  if (answer.applied) text += "; the server goes on there when the scans that follow confirm it";
  return text + "\n";
}

ExitCode run(const LocateArguments& arguments) {
  if (!std::ranges::all_of(arguments.near, [](double value) { return std::isfinite(value); }))
    throw std::invalid_argument("--near takes finite numbers: X Y [m] and heading [degrees]");
  if (arguments.near.empty() && (arguments.radius_m != 20.0 || arguments.max_turn_deg != 180.0))
    throw std::invalid_argument("--radius and --max-turn are round the pose of --near");
  Client client = connect(arguments.client);
  const LocalizationAnswer answer = client.localize(question_of(arguments));
  std::cout << (arguments.json ? to_json(answer).dump(2) + "\n" : describe(answer));
  return answer.outcome == LocalizationStatus::found ? ExitCode::ok : ExitCode::failed;
}

}  // namespace

void add_locate_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<LocateArguments>();
  CommandHandle command = program.command(
      "locate", "Ask a server where the robot is: look for its last scan in the whole map");
  command
      .option("--near", arguments->near, "X Y [m] and heading [degrees]: look near this pose alone")
      .exactly(3)
      .comma_separated();
  command.option("--radius", arguments->radius_m, "Look so far from it [m]")
      .above_zero_to(10'000)
      .with_default();
  command.option("--max-turn", arguments->max_turn_deg, "It is turned by so much at most [degrees]")
      .above_zero()
      .with_default();
  command.flag("--apply", arguments->apply,
               "Where it is found, have the server go on there, once the next scans confirm it");
  add_client_options(command, arguments->client);
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap locate\n"
      "  stillmap locate --near 12 -3.5 90 --radius 30 --apply\n"
      "  stillmap locate --json | jq .pose.position\n"
      "The pose is the robot's in the map. It is given only where it is found: ambiguous is a scan "
      "that several places fit, not_found one that none does, no_evidence one that shows too "
      "little. Exit code 1 where it is not found. Nothing changes without --apply. A server that "
      "is lost looks for itself ('stillmap status' says how that goes); this is for one that is "
      "wrong, and for those who want to know. Scans of a file are found by 'stillmap localize'.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
