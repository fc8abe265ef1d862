#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "clients/commands/command.hpp"
#include "clients/commands/evaluate/weighting_comparison.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"

namespace stillmap::cli {
namespace {

struct Arguments {
  std::vector<std::string> recordings{"sim:crowd", "sim:quiet"};
  std::size_t scans = 700;
  MapperArguments mapper;
  SimulationArguments simulation;
  bool json = false;
};

/// How often an error fits into that of no weighting; 1 where both are nothing.
double times_better(const WeightingResult& none, const WeightingResult& result) {
  const double of_none = none.report.rigid_aligned.rmse_m;
  const double of_this = result.report.rigid_aligned.rmse_m;
  return of_this > 0.0 ? of_none / of_this : 1.0;
}

void add_rows(Table& table, const GroundTruthSequence& recording,
              const std::vector<WeightingResult>& results) {
  for (const WeightingResult& result : results) {
    const TrajectoryReport& report = result.report;
    const auto& kitti = report.kitti;
    const auto& step = report.relative;
    table.add({recording.name, result.weighting, fixed(report.path_m, 0),
               fixed(report.rigid_aligned.rmse_m, 3), fixed(report.first_aligned.final_m, 2),
               step ? fixed(100.0 * step->mean_translation_m, 2) : "-",
               kitti ? fixed(kitti->translation_percent, 3) : "-",
               fixed(times_better(results.front(), result), 2), fixed(result.median_ms, 0)});
  }
}

nlohmann::json json_of(const GroundTruthSequence& recording,
                       const std::vector<WeightingResult>& results) {
  nlohmann::json rows = nlohmann::json::array();
  for (const WeightingResult& result : results) {
    nlohmann::json row = to_json(result.report);
    row["recording"] = recording.name;
    row["weighting"] = result.weighting;
    row["times_better_than_none"] = times_better(results.front(), result);
    row["median_ms"] = result.median_ms;
    rows.push_back(row);
  }
  return rows;
}

ExitCode run(const Arguments& arguments) {
  StopSignal stop;
  Table table({"recording", "weighting", "path m", "ATE RMSE m", "final drift m", "cm a scan",
               "KITTI %", "none / this", "ms a scan"});
  nlohmann::json rows = nlohmann::json::array();
  for (const std::string& name : arguments.recordings) {
    const GroundTruthSequence recording =
        open_ground_truth_sequence(name, arguments.scans, arguments.mapper, arguments.simulation);
    Progress progress(name, "scans", recording.scans);
    const auto results = compare_weightings(recording, [&](std::size_t seen) {
      progress.update(seen);
      return !stop.requested();
    });
    add_rows(table, recording, results);
    for (const nlohmann::json& row : json_of(recording, results)) rows.push_back(row);
    if (stop.requested()) break;
  }
  std::cout << (arguments.json ? rows.dump(2) + "\n" : table.text());
  return stop.requested() ? ExitCode::failed : ExitCode::ok;
}

}  // namespace

void add_evaluate_weightings_command(CommandHandle evaluate, Action& action) {
  auto arguments = std::make_shared<Arguments>();
  CommandHandle command = evaluate.command(
      "weightings", "The paper's Table I: no, geometric and semantic weights on the same scans");
  command
      .option("RECORDINGS", arguments->recordings,
              "Recordings with true poses, or sim:crowd, sim:quiet, sim:yard")
      .with_default();
  command.option("--scans", arguments->scans, "Take as many scans of each at most")
      .above_zero()
      .with_default();
  command.option("--seed", arguments->simulation.seed, "Of simulated cities").with_default();
  command.option("--config", arguments->mapper.config_file,
                 "Server file; its mapper settings are used");
  command.option("--sensor", arguments->simulation.sensor, "Of simulated recordings")
      .with_default();
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap evaluate weightings\n"
      "  stillmap evaluate weightings sim:crowd --seed 3 --scans 400\n"
      "  stillmap evaluate weightings sequences/10\n"
      "ATE after the best rigid fit; final drift with the first poses aligned. The last column "
      "but\n"
      "one says how often the error fits into that of no weighting.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
