#include <Eigen/Geometry>
#include <algorithm>
#include <functional>
#include <iostream>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "clients/commands/arguments/mapper_arguments.hpp"
#include "clients/commands/arguments/simulation_arguments.hpp"
#include "clients/commands/command.hpp"
#include "clients/commands/evaluate/ground_truth_sequence.hpp"
#include "clients/commands/mapping/trajectory_report.hpp"
#include "clients/commands/stage_stopwatch.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/progress.hpp"
#include "clients/terminal/stop_signal.hpp"
#include "clients/terminal/table.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/mapper.hpp"
#include "core/segmentation/segmenter.hpp"

namespace stillmap::cli {
namespace {

/// One row of the paper's Table I.
struct WeightingResult {
  std::string weighting;
  TrajectoryReport report;
  double median_ms = 0.0;
};

/// One of the mappers that are compared, and its stage times.
struct WeightingRun {
  WeightingRun(const NamedWeighting& row, MapperConfig config, bool labelled)
      : weighting(row.name) {
    config.odometry.weighting = row.weighting;
    std::unique_ptr<Segmenter> labels = std::make_unique<NullSegmenter>();
    if (labelled) labels = std::make_unique<PassthroughSegmenter>();
    mapper = std::make_unique<Mapper>(config, std::move(labels));
  }

  void map(const Scan& scan, const std::string& sequence_name) {
    times.begin();
    if (!mapper->process(scan)) {
      throw std::runtime_error("a scan of " + sequence_name +
                               " cannot be mapped: " + mapper->last_rejection().reason);
    }
    times.end();
  }

  [[nodiscard]] WeightingResult result(const std::vector<Eigen::Isometry3d>& truth) const {
    evaluation::PosePairs pairs;
    for (const StampedPose& pose : mapper->trajectory()) {
      pairs.truth.push_back(truth.at(pairs.estimate.size()));
      pairs.estimate.push_back(pose.T_map_lidar);
    }
    return {weighting, report_trajectory(evaluation::pair_by_index(pairs.truth, pairs.estimate)),
            times.total().quantile(0.5)};
  }

  std::string weighting;
  std::unique_ptr<Mapper> mapper;
  StageStopwatch times;
};

/// Runs the three weightings side by side on the same scans. `scan_done(seen)` returning false ends
/// it early. Throws std::runtime_error when a scan cannot be mapped.
std::vector<WeightingResult> compare_weightings(const GroundTruthSequence& sequence,
                                                const MapperConfig& config, std::size_t max_scans,
                                                const std::function<bool(std::size_t)>& scan_done) {
  std::vector<WeightingRun> runs;
  runs.reserve(named_weightings.size());
  for (const NamedWeighting& row : named_weightings) {
    runs.emplace_back(row, config, sequence.labelled);
  }
  for (std::size_t i = 0; i < std::min(max_scans, sequence.size()); ++i) {
    const Scan scan = sequence.read(i);
    for (WeightingRun& run : runs) run.map(scan, sequence.name);
    if (!scan_done(i + 1)) break;
  }
  std::vector<WeightingResult> results;
  results.reserve(runs.size());
  for (const WeightingRun& run : runs) {
    results.push_back(run.result(sequence.truth));
  }
  return results;
}

struct EvaluateWeightingsArguments {
  std::vector<std::string> sequences{"sim:crowd", "sim:quiet"};
  std::size_t scans = 700;
  MapperArguments mapper;
  SimulationArguments simulation;
  bool json = false;
};

/// ATE without weighting divided by this ATE; 1 where both are 0.
double error_reduction_factor(const WeightingResult& none, const WeightingResult& result) {
  const double of_none = none.report.rigid_aligned.rmse_m;
  const double of_this = result.report.rigid_aligned.rmse_m;
  return of_this > 0.0 ? of_none / of_this : 1.0;
}

void add_rows(Table& table, const GroundTruthSequence& sequence,
              const std::vector<WeightingResult>& results) {
  for (const WeightingResult& result : results) {
    const TrajectoryReport& report = result.report;
    const auto& kitti = report.kitti;
    const auto& step = report.relative;
    table.add({sequence.name, result.weighting, fixed(report.path_m, 0),
               fixed(report.rigid_aligned.rmse_m, 3), fixed(report.first_aligned.final_m, 2),
               step ? fixed(100.0 * step->mean_translation_m, 2) : "-",
               kitti ? fixed(kitti->translation_percent, 3) : "-",
               fixed(error_reduction_factor(results.front(), result), 2),
               fixed(result.median_ms, 0)});
  }
}

Json json_of(const GroundTruthSequence& sequence, const std::vector<WeightingResult>& results) {
  Json rows = Json::array();
  for (const WeightingResult& result : results) {
    Json row = to_json(result.report);
    row.set("sequence", sequence.name);
    row.set("weighting", result.weighting);
    row.set("error_reduction_factor", error_reduction_factor(results.front(), result));
    row.set("median_ms", result.median_ms);
    rows.push_back(row);
  }
  return rows;
}

ExitCode run(const EvaluateWeightingsArguments& arguments) {
  StopSignal stop;
  SimulationArguments simulated = arguments.simulation;
  simulated.scans = static_cast<int>(std::min<std::size_t>(arguments.scans, 100'000));
  Table table({"sequence", "weighting", "path m", "ATE RMSE m", "final drift m", "cm a scan",
               "KITTI %", "none / this", "ms a scan"});
  Json rows = Json::array();
  for (const std::string& name : arguments.sequences) {
    const GroundTruthSequence sequence = open_ground_truth_sequence(name, simulated);
    if (sequence.truth.empty())
      throw DatasetError(name, "has no true poses (poses.txt or poses_lidar.txt)");
    const MapperConfig config = mapper_config(arguments.mapper, sequence.sensor);
    Progress progress(name, "scans", std::min(arguments.scans, sequence.size()));
    const auto seen = [&](std::size_t scans) {
      progress.update(scans);
      return !stop.requested();
    };
    const auto results = compare_weightings(sequence, config, arguments.scans, seen);
    add_rows(table, sequence, results);
    rows.append(json_of(sequence, results));
    if (stop.requested()) break;
  }
  std::cout << (arguments.json ? rows.dump(2) + "\n" : table.text());
  return stop.requested() ? ExitCode::failed : ExitCode::ok;
}

}  // namespace

void add_evaluate_weightings_command(CommandHandle evaluate, Action& action) {
  auto arguments = std::make_shared<EvaluateWeightingsArguments>();
  CommandHandle command = evaluate.command(
      "weightings", "The paper's Table I: no, geometric and semantic weights on the same scans");
  command
      .option("SEQUENCES", arguments->sequences,
              "Sequences with true poses, or sim:crowd, sim:quiet, sim:yard (see evaluate drives)")
      .with_default();
  command.option("--scans", arguments->scans, "Take as many scans of each at most")
      .above_zero()
      .with_default();
  command.option("--seed", arguments->simulation.seed, "Of simulated cities").with_default();
  command.option("--config", arguments->mapper.config_file,
                 "Server file; its mapper settings are used");
  command.option("--sensor", arguments->simulation.sensor, "Of simulated sequences").with_default();
  command.flag("--json", arguments->json, "Print JSON");
  command.explain(
      "Examples:\n"
      "  stillmap evaluate weightings\n"
      "  stillmap evaluate weightings sim:crowd --seed 3 --scans 400\n"
      "  stillmap evaluate weightings sequences/10\n"
      "ATE after the best rigid fit; final drift with the first poses aligned. Column 'none / "
      "this' is the ATE without weighting divided by this ATE.");
  command.on_chosen([arguments, &action] { action = [arguments] { return run(*arguments); }; });
}

}  // namespace stillmap::cli
