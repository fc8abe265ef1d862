#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>
#include <tbb/partitioner.h>
#include <tbb/task_group.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <iostream>
#include <memory>
#include <mutex>
#include <stdexcept>
#include <string>
#include <system_error>

#include "clients/commands/arguments/simulation_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "config/loaders/sensor_file.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/dataset/kitti_sequence_writer.hpp"
#include "core/simulation/training_city.hpp"

namespace stillmap::cli {
namespace {

/// The simulated cities of a training set.
struct TrainingSetPlan {
  std::filesystem::path folder;
  int cities = 200;
  std::uint64_t first_seed = 1000;
  int scans_per_city = 8;
  /// Share of sequences in plain cities, see simulation::training_sequence.
  double share_of_plain = 0.4;
};

struct TrainingSetCount {
  int cities = 0;
  /// Of these, complete before the run began.
  int skipped = 0;
  std::uint64_t scans = 0, points = 0;
};

namespace fs = std::filesystem;

std::string sequence_name(std::uint64_t seed) {
  const std::string digits = std::to_string(seed);
  return std::string(digits.size() < 4 ? 4 - digits.size() : 0, '0').append(digits);
}

// Written under another name and renamed when complete.
TrainingSetCount write_city(const fs::path& sequence, std::uint64_t seed,
                            const TrainingSetPlan& plan) {
  const fs::path unfinished = fs::path(sequence).concat(".unfinished");
  fs::remove_all(unfinished);
  const simulation::Simulation simulated(simulation::training_sequence(seed, plan.share_of_plain));
  KittiSequenceWriter writer(unfinished);
  TrainingSetCount count{.cities = 1};
  for (const int index : simulation::spread_scans(simulated, plan.scans_per_city)) {
    const simulation::SimulatedScan scan = simulated.scan(index);
    writer.add(scan.scan, scan.raw_labels, scan.T_map_lidar);
    count.scans += 1;
    count.points += scan.scan.size();
  }
  writer.finish();
  save_sensor(simulated.config().sensor, unfinished / "sensor.yaml");
  fs::rename(unfinished, sequence);
  return count;
}

/// Writes `folder`/sequences/SEED for each seed, several cities at a time (oneTBB): a SemanticKITTI
/// sequence and the sensor.yaml of its lidar. Cities that are complete stay as they are; a city
/// appears under its name only when it is.
/// @param after_city called after every city, by one thread at a time; false ends the run.
/// @throws DatasetError, or std::runtime_error that names the file.
TrainingSetCount write_training_set(
    const TrainingSetPlan& plan, const std::function<bool(const TrainingSetCount&)>& after_city) {
  std::error_code error;
  fs::create_directories(plan.folder / "sequences", error);
  if (error) throw DatasetError(plan.folder, "cannot be made: " + error.message());
  std::mutex mutex;
  TrainingSetCount total;
  tbb::task_group_context run;
  const auto add = [&](const TrainingSetCount& city) {
    const std::lock_guard lock(mutex);
    total.cities += city.cities;
    total.skipped += city.skipped;
    total.scans += city.scans;
    total.points += city.points;
    if (!after_city(total)) run.cancel_group_execution();
  };
  const auto write = [&](int index) {
    const std::uint64_t seed = plan.first_seed + static_cast<std::uint64_t>(index);
    const fs::path sequence = plan.folder / "sequences" / sequence_name(seed);
    add(fs::exists(sequence) ? TrainingSetCount{.cities = 1, .skipped = 1}
                             : write_city(sequence, seed, plan));
  };
  tbb::parallel_for(0, plan.cities, write, tbb::simple_partitioner(), run);
  return total;
}

struct SimulateTrainingArguments {
  std::string out;
  TrainingSetPlan plan;
  int jobs = tbb::info::default_concurrency();
  bool json = false;
};

ExitCode run(const SimulateTrainingArguments& arguments) {
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
    std::cout << Json{{"folder", arguments.out},
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
  auto arguments = std::make_shared<SimulateTrainingArguments>();
  CommandHandle command = program.command(
      "simulate-training",
      "Make a training set for segmentation: labelled scans of many simulated cities");
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
              "Share of cities as `stillmap simulate` makes them, 0..1")
      .with_default();
  command.option("--jobs", arguments->jobs, "Threads").above_zero().with_default();
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Every city draws its streets, plants, houses, traffic, materials and its lidar at random, "
      "harder than life: 60 % HDL-64E, 20 % VLP-16, 10 % HDL-32E, 10 % sensors that nobody builds, "
      "all with the flaws that real ones have. sequences/SEED/sensor.yaml tells the lidar's rings "
      "and field of view. The same seed gives the same files.\n"
      "A run that was stopped can be repeated: complete cities are skipped.\n"
      "Examples:\n"
      "  stillmap simulate-training train --cities 1000\n"
      "  stillmap simulate-training validation --cities 40 --first-seed 900000");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
