#include <iostream>
#include <memory>

#include "clients/commands/arguments/simulation_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/evaluate/traversability_truth.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"
#include "config/loaders/robot_profile.hpp"
#include "core/map/storage/map_file_copy.hpp"
#include "core/traversability/traversability_map.hpp"

namespace stillmap::cli {
namespace {

struct EvaluateTraversableArguments {
  std::string map;
  std::string profile = "car";
  SimulationArguments simulation;
  bool json = false;
};

Json number(const std::optional<double>& value) { return value ? Json(*value) : Json(nullptr); }

Json to_json(const evaluation::TraversabilityScore& score, double cell_m2) {
  Json false_free = Json::object();
  for (std::size_t i = 0; i < evaluation::false_free_count; ++i) {
    false_free.set(std::string(name(static_cast<evaluation::FalseFree>(i))),
                   cell_m2 * static_cast<double>(score.false_free.at(i)));
  }
  Json false_lethal = Json::object();
  for (std::size_t i = 0; i < block_reason_count; ++i) {
    if (score.false_lethal.at(i) == 0) continue;
    false_lethal.set(std::string(name(static_cast<BlockReason>(i))),
                     cell_m2 * static_cast<double>(score.false_lethal.at(i)));
  }
  return {{"precision_with_parked_vehicles", number(score.precision(false))},
          {"precision", number(score.precision(true))},
          {"recall", number(score.recall())},
          {"free_m2", cell_m2 * static_cast<double>(score.free_and_truly_free)},
          {"lethal_m2", cell_m2 * static_cast<double>(score.lethal_and_truly_lethal)},
          {"false_free_m2", false_free},
          {"false_lethal_m2", false_lethal}};
}

std::string describe(const evaluation::TraversabilityScore& score, double cell_m2) {
  const auto area = [&](std::uint64_t cells) {
    return fixed(cell_m2 * static_cast<double>(cells), 1);
  };
  const auto percent = [](const std::optional<double>& share) {
    return share ? fixed(100.0 * *share, 2) + " %" : std::string("-");
  };
  Table table({"against the true city", "m2"});
  table.add({"free, and truly so", area(score.free_and_truly_free)});
  table.add({"lethal, and truly so", area(score.lethal_and_truly_lethal)});
  for (std::size_t i = 0; i < evaluation::false_free_count; ++i) {
    table.add({"false free: " + std::string(name(static_cast<evaluation::FalseFree>(i))),
               area(score.false_free.at(i))});
  }
  for (std::size_t i = 0; i < block_reason_count; ++i) {
    if (score.false_lethal.at(i) == 0) continue;
    table.add({"false lethal: " + std::string(name(static_cast<BlockReason>(i))),
               area(score.false_lethal.at(i))});
  }
  return table.text() + "precision of free " + percent(score.precision(true)) +
         " (with the parked vehicles still there " + percent(score.precision(false)) +
         "), recall " + percent(score.recall()) + "\n";
}

ExitCode run(const EvaluateTraversableArguments& arguments) {
  end_cleanly_when_stopped();
  const RobotProfile profile = load_robot_profile(arguments.profile);
  const SavedMap map = read_map_file(arguments.map);
  const simulation::SimulationConfig config = simulation_config(arguments.simulation);
  // The map's frame is the lidar's at the first scan, or that of the robot with its mount.
  const Eigen::Isometry3d T_lidar_body =
      config.T_base_lidar.value_or(Eigen::Isometry3d::Identity()).inverse();
  const Eigen::Isometry3d T_city_map =
      simulation::Simulation(config).T_map_lidar_at(0.0) * T_lidar_body;
  const simulation::CityTruth truth(config);
  TraversabilityMap area({profile});
  (void)area.update(map.view);
  const TraversabilityView& view = *area.view(profile.name);
  const evaluation::TraversabilityScore score = evaluation::score_traversability(
      view, simulated_traversability(truth, profile, view.cell_m, T_city_map));
  const double cell_m2 = view.cell_m * view.cell_m;
  std::cout << (arguments.json ? to_json(score, cell_m2).dump(2) + "\n" : describe(score, cell_m2));
  return ExitCode::ok;
}

}  // namespace

void add_evaluate_traversable_command(CommandHandle evaluate, Action& action) {
  auto arguments = std::make_shared<EvaluateTraversableArguments>();
  SimulationArguments& simulation = arguments->simulation;
  CommandHandle command = evaluate.command(
      "traversable", "Precision and recall of a robot's free area on a map of a simulated city");
  command.option("--map", arguments->map, "Map file made from the sequence (map.stillmap)")
      .required();
  command.option("--preset", simulation.preset, "As given to 'stillmap simulate'").with_default();
  command.option("--traffic", simulation.traffic, "As given to 'stillmap simulate'")
      .zero_to(10)
      .with_default();
  command.option("--sensor", simulation.sensor, "As given to 'stillmap simulate'").with_default();
  command.option("--seed", simulation.seed, "As given to 'stillmap simulate'").with_default();
  command.option("--day", simulation.day, "As given to 'stillmap simulate'").with_default();
  command.option("--motion", simulation.motion, "As given to 'stillmap simulate'").with_default();
  add_mount_option(command, simulation.mount, "As given to 'stillmap simulate' and 'stillmap map'");
  command.option("--profile", arguments->profile, "The robot, or its file").with_default();
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Example:\n"
      "  stillmap simulate city --preset quiet --seed 1 --scans 200\n"
      "  stillmap map city --out city_map\n"
      "  stillmap evaluate traversable --map city_map/map.stillmap --preset quiet --seed 1\n"
      "Over the cells that are not unknown, without the safety margin. The map must begin with\n"
      "the sequence's first scan. Every cell that is called free and is not has a cause.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
