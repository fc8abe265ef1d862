#include <tbb/global_control.h>
#include <tbb/info.h>

#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "clients/commands/arguments/simulation_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/simulate/training_set.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/stop_signal.hpp"

namespace stillmap::cli {
namespace {

struct Arguments {
  std::string out;
  TrainingSetPlan plan;
  int jobs = tbb::info::default_concurrency();
  bool json = false;
};

ExitCode run(const Arguments& arguments) {
  check_seed("--first-seed", arguments.plan.first_seed);
  if (const double share = arguments.plan.share_of_plain; !(share >= 0.0 && share <= 1.0)) {
    throw std::invalid_argument("--plain-share " + std::to_string(share) +
                                " is no share; it may be 0 to 1");
  }
  StopSignal stop;
  const tbb::global_control threads(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(arguments.jobs));
  TrainingSetPlan plan = arguments.plan;
  plan.folder = arguments.out;
  TrainingSetCount count;
  {
    Progress progress("simulate-training", "cities", static_cast<std::uint64_t>(plan.cities));
    count = write_training_set(plan, [&](const TrainingSetCount& so_far) {
      progress.update(static_cast<std::uint64_t>(so_far.cities),
                      std::to_string(so_far.scans) + " scans");
      return !stop.requested();
    });
  }
  if (arguments.json) {
    std::cout << nlohmann::json{{"folder", arguments.out},
                                {"cities", count.cities},
                                {"skipped", count.skipped},
                                {"scans", count.scans},
                                {"points", count.points}}
                     .dump(2)
              << "\n";
  } else {
    std::cout << count.cities << " cities (" << count.skipped << " were there), " << count.scans
              << " new scans, " << count.points << " points: " << arguments.out << "/sequences/\n";
  }
  return count.cities == plan.cities ? ExitCode::ok : ExitCode::failed;
}

}  // namespace

void add_simulate_training_command(CommandHandle program, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command = program.command(
      "simulate-training",
      "Make a training set for segmentation: labelled scans of many made-up cities");
  command.option("OUT", arguments->out, "Folder; gets sequences/SEED").required();
  command.option("--cities", arguments->plan.cities, "How many").above_zero().with_default();
  command
      .option("--first-seed", arguments->plan.first_seed,
              "Seed of the first city; the others follow")
      .with_default();
  command
      .option("--scans-per-city", arguments->plan.scans_per_city,
              "Scans of each city, at least 8 m apart; fewer where its route is short")
      .above_zero()
      .with_default();
  command
      .option("--plain-share", arguments->plan.share_of_plain,
              "Share of drives through the cities of `stillmap simulate` instead, 0..1")
      .with_default();
  command.option("--jobs", arguments->jobs, "Threads").above_zero().with_default();
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Every city draws its streets, plants, houses, traffic, materials and its lidar anew, "
      "harder\n"
      "than life: 60 % HDL-64E, 20 % VLP-16, 10 % HDL-32E, 10 % sensors that nobody builds, all\n"
      "with the flaws that real ones have. sequences/SEED/sensor.yaml tells the lidar's rings and\n"
      "field of view. The same seed gives the same files.\n"
      "A run that was stopped goes on where it was: complete cities are left as they are.\n"
      "Examples:\n"
      "  stillmap simulate-training train --cities 1000\n"
      "  stillmap simulate-training validation --cities 40 --first-seed 900000");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
