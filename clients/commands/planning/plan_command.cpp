#include <charconv>
#include <chrono>
#include <filesystem>
#include <iostream>
#include <memory>

#include "clients/commands/arguments/client_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/planning/replanner.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "config/loaders/robot_profile.hpp"
#include "core/lidar/angle_units.hpp"
#include "core/map/storage/map_file_copy.hpp"
#include "core/picture/traversability_picture.hpp"

namespace stillmap::cli {
namespace {

struct PlanArguments {
  ClientArguments client;
  std::string map;
  std::vector<std::string> from;
  std::vector<std::string> to;
  std::string profile = "car";
  bool through_unknown = false;
  double time_limit_s = 2.0;
  std::uint64_t max_iterations = PlanningConfig{}.max_steps;
  std::uint32_t seed = 1;
  std::string planner = std::string(name(PlannerKind::rrt_connect));
  std::string sampling = "route";
  std::string output;
  std::string picture;
  bool follow = false;
  double duration_s = 0.0;
  /// 0: no limit.
  std::uint64_t count = 0;
  bool json = false;
};

/// "x,y" or "x,y,heading", in one word or several: metres and degrees.
Goal place_of(const std::string& option, const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : ",") + word;
  std::vector<double> values;
  const char* at = text.data();
  const char* const end = at + text.size();
  while (at <= end) {
    double value = 0.0;
    const auto [stop, error] = std::from_chars(at, end, value);
    const bool is_last = stop == end;
    if (error != std::errc{} || (!is_last && *stop != ',')) break;
    values.push_back(value);
    at = is_last ? end + 1 : stop + 1;
  }
  if (at != end + 1 || values.size() < 2 || values.size() > 3) {
    throw std::invalid_argument(option + " " + text +
                                ": must be x,y or x,y,heading in metres and degrees of the map "
                                "frame, as 12.5,-3 or 12.5,-3,90");
  }
  Goal place{{values[0], values[1]}, std::nullopt};
  if (values.size() == 3) place.heading_rad = values[2] * rad_per_deg;
  return place;
}

/// Throws std::invalid_argument for a name that is none.
PlannerKind planner_of(const std::string& text) {
  for (std::size_t i = 0; i < planner_kind_count; ++i) {
    const auto kind = static_cast<PlannerKind>(i);
    if (name(kind) == text) return kind;
  }
  throw std::invalid_argument("--planner " + text + ": there is no such planner");
}

std::vector<std::string> planner_names() {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < planner_kind_count; ++i) {
    names.emplace_back(name(static_cast<PlannerKind>(i)));
  }
  return names;
}

PlanTask task_of(const PlanArguments& arguments) {
  PlanTask task;
  task.profile = load_robot_profile(arguments.profile);
  if (arguments.through_unknown) task.profile.unknown = UnknownGround::allowed;
  if (!arguments.from.empty()) task.from = place_of("--from", arguments.from);
  task.to = place_of("--to", arguments.to);
  task.config.planner = planner_of(arguments.planner);
  task.config.route_guided = arguments.sampling == "route";
  task.config.max_steps = arguments.max_iterations;
  task.config.seed = arguments.seed;
  task.time_limit_s = arguments.time_limit_s;
  const std::string faults = task.config.faults();
  if (!faults.empty()) throw std::invalid_argument(faults);
  return task;
}

void print(const PlanArguments& arguments, const TimedPlan& timed) {
  if (arguments.json) {
    std::cout << to_json(timed, !arguments.follow).dump(arguments.follow ? -1 : 2) << std::endl;
  } else {
    std::cout << (arguments.follow ? one_line(timed) : describe(timed)) << std::flush;
  }
}

/// Prints plans, and writes and draws them where that was asked for.
class PlanOutput {
 public:
  explicit PlanOutput(const PlanArguments& arguments) : arguments_(arguments) {}

  void show(const Replanner& replanner) {
    print(arguments_, replanner.last());
    if (!arguments_.output.empty()) write(replanner.last());
    if (arguments_.picture.empty()) return;
    const std::vector<PlanarPose> path_map = replanner.last().plan.path_map();
    TraversabilityPictureOptions options;
    options.path_map = path_map;
    write_traversability_picture(arguments_.picture, replanner.traversability(), options);
  }

 private:
  /// Without a path the file of an earlier run stays; one of this run, which is blocked now, does
  /// not: whoever reads it drives by it.
  void write(const TimedPlan& timed) {
    if (!timed.plan.is_found() && !has_written_) {
      if (std::filesystem::exists(arguments_.output))
        std::cerr << "stillmap: " << arguments_.output << " stays as it was: there is no path\n";
      return;
    }
    write_plan(arguments_.output, timed);
    has_written_ = true;
  }

  const PlanArguments& arguments_;
  bool has_written_ = false;
};

ExitCode code_of(const TimedPlan& timed) {
  if (timed.plan.status == PlanStatus::invalid_request) return ExitCode::bad_input;
  return timed.plan.is_found() ? ExitCode::ok : ExitCode::no_path;
}

ExitCode plan_on_file(const PlanArguments& arguments) {
  if (arguments.follow) {
    throw std::invalid_argument(
        "--follow: a map file does not change; leave out --map to follow "
        "a server's map");
  }
  PlanTask task = task_of(arguments);
  const SavedMap map = read_map_file(arguments.map);
  if (!task.from) {
    throw std::invalid_argument("--from: a stored map has no robot; give x,y or x,y,heading");
  }
  Replanner replanner(std::move(task));
  (void)replanner.plan(map.view, std::nullopt);
  PlanOutput(arguments).show(replanner);
  return code_of(replanner.last());
}

/// Plans again whenever the map requires it, until a limit is reached.
void follow(const PlanArguments& arguments, Replanner& replanner, PlanOutput& output,
            const TileMirror& mirror, std::shared_ptr<const MapSnapshot> map,
            const std::optional<RobotPoseSubscription>& robot, StopSignal& stop) {
  const auto began = std::chrono::steady_clock::now();
  const auto is_over = [&](std::uint64_t plans) {
    const std::chrono::duration<double> followed = std::chrono::steady_clock::now() - began;
    return (arguments.duration_s > 0.0 && followed.count() >= arguments.duration_s) ||
           (arguments.count > 0 && plans >= arguments.count);
  };
  for (std::uint64_t plans = 1; !is_over(plans) && !stop.requested();) {
    const auto newest = mirror.wait_for_change(map, std::chrono::milliseconds(50));
    if (newest == map) continue;
    map = newest;
    if (!replanner.replan_if_needed(*map, robot ? std::optional(robot->pose()) : std::nullopt))
      continue;
    ++plans;
    output.show(replanner);
  }
}

ExitCode plan_on_server(const PlanArguments& arguments) {
  PlanTask task = task_of(arguments);
  StopSignal stop;
  Client client = connect(arguments.client);
  TileMirror mirror;
  const Subscription tiles = client.subscribe_region(
      BoxRegion{}, [&](const RegionUpdate& update) { mirror.apply(update); });
  const auto unreadable = wait_for_whole_map(client, mirror, arguments.client.timeout());
  if (!unreadable.empty()) {
    std::cerr << "stillmap: the server cannot read " << unreadable.size()
              << " tiles of its map, the first is (" << unreadable.front().x << ", "
              << unreadable.front().y << "): there the plan knows nothing\n";
  }
  std::optional<RobotPoseSubscription> robot;
  if (!task.from) robot.emplace(client, arguments.client.timeout());
  Replanner replanner(std::move(task));
  const auto map = mirror.snapshot();
  (void)replanner.plan(*map, robot ? std::optional(robot->pose()) : std::nullopt);
  PlanOutput output(arguments);
  output.show(replanner);
  if (arguments.follow) follow(arguments, replanner, output, mirror, map, robot, stop);
  return code_of(replanner.last());
}

ExitCode run(const PlanArguments& arguments) {
  // Before the search, not after it.
  if (!arguments.output.empty()) check_plan_file(arguments.output);
  return arguments.map.empty() ? plan_on_server(arguments) : plan_on_file(arguments);
}

void add_search_options(CommandHandle command, PlanArguments& arguments) {
  command.renamed("--time", "--time-limit");
  command.renamed("--steps", "--max-iterations");
  command.option("--time-limit", arguments.time_limit_s, "Longest search [s]")
      .above_zero()
      .with_default();
  command
      .option("--max-iterations", arguments.max_iterations,
              "Longest search in iterations of the planner; the same result on every machine")
      .with_default();
  command.option("--seed", arguments.seed, "Seed of the search, 1 or more").with_default();
  command.option("--planner", arguments.planner, "Planner of OMPL")
      .one_of(planner_names())
      .with_default();
  command
      .option("--sampling", arguments.sampling,
              "Where the search looks: beside the coarse route that A* finds, or everywhere alike")
      .one_of({"route", "uniform"})
      .with_default();
}

}  // namespace

void add_plan_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<PlanArguments>();
  CommandHandle command =
      program.command("plan", "A path that a robot can drive, on a server's map or a stored one");
  command.option("--to", arguments->to, "Goal: x,y or x,y,heading, metres and degrees, map frame")
      .up_to(3)
      .required();
  command
      .option("--from", arguments->from,
              "Start, as --to; without it the robot's newest pose (of a server's map)")
      .up_to(3);
  command
      .option("--profile", arguments->profile,
              "The robot: car, delivery_robot, tracked, or a file like config/robots/car.yaml")
      .with_default();
  command.flag("--through-unknown", arguments->through_unknown,
               "Unknown ground may be driven on; without it as the profile says");
  command.option("--map,MAPFILE", arguments->map, "Plan on a map file instead of a server's map");
  command.option("--output,--out,-o", arguments->output, "Write the path to FILE.json or FILE.csv");
  command
      .option("--picture", arguments->picture, "Draw the traversability and the path to FILE.png")
      .ends_in(".png");
  const OptionHandle follow =
      command.flag("--follow", arguments->follow,
                   "Stay subscribed and plan again when the path is blocked or the route changes; "
                   "says why");
  command.option("--duration", arguments->duration_s, "End --follow after as many seconds")
      .above_zero()
      .needs(follow);
  command.option("--count", arguments->count, "End --follow after as many plans").needs(follow);
  command.flag("--json", arguments->json, "Print JSON; with --follow a line for every plan");
  add_search_options(command, *arguments);
  add_client_options(command, arguments->client);
  command.explain(
      "Examples:\n"
      "  stillmap plan --map city_map/map.stillmap --from 0,0,0 --to 80,-3 --picture path.png\n"
      "  stillmap plan --to 80,-3,180 --output path.csv       from where the robot is\n"
      "  stillmap plan --to 0,0 --follow --picture path.png   until Ctrl-C\n"
      "The path keeps the robot's whole footprint on free cells and its turning radius "
      "(min_turning_radius_m of the profile); driving backwards costs three times as much. Exit "
      "code 4 when there is no path: start or goal is blocked, no route is known, or the search "
      "ran out of time; with --follow, of the last plan. Then the file of --output stays as it "
      "was, unless this run has written it: where the path of --follow is blocked, it has none.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
