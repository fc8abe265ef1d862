#include "clients/commands/evaluate/weighting_comparison.hpp"

#include <algorithm>
#include <array>
#include <memory>
#include <optional>
#include <stdexcept>
#include <utility>

#include "clients/commands/stage_stopwatch.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/segmentation/segmenter.hpp"

namespace stillmap::cli {
namespace {

constexpr std::array weighting_names{"none", "geometric", "semantic"};
const std::string simulated = "sim:";

GroundTruthSequence open_simulated(const std::string& name, std::size_t max_scans,
                                   const MapperArguments& mapper, SimulationArguments arguments) {
  arguments.preset = name.substr(simulated.size());
  arguments.scans = static_cast<int>(std::min<std::size_t>(max_scans, 100'000));
  const simulation::SimulationConfig config = simulation_config(arguments);
  const auto simulation = std::make_shared<simulation::Simulation>(config);
  GroundTruthSequence recording;
  recording.name = name + " seed " + std::to_string(arguments.seed);
  recording.scans = static_cast<std::size_t>(config.scans);
  recording.config = mapper_config(mapper, config.sensor);
  recording.labelled = true;
  recording.read = [simulation](std::size_t i) {
    simulation::SimulatedScan scan = simulation->scan(static_cast<int>(i));
    return DatasetFrame{std::move(scan.scan), std::move(scan.raw_labels)};
  };
  for (int i = 0; i < config.scans; ++i) {
    recording.truth.push_back(simulation->T_map_lidar_at(i * config.sensor.period_s));
  }
  return recording;
}

GroundTruthSequence open_dataset(const std::string& name, std::size_t max_scans,
                                 const MapperArguments& mapper) {
  const auto dataset = std::make_shared<ScanDataset>(name);
  const std::optional<Trajectory> truth = dataset->truth();
  if (!truth) throw DatasetError(name, "has no true poses (poses.txt or poses_lidar.txt)");
  GroundTruthSequence recording;
  recording.name = name;
  recording.scans = std::min(max_scans, dataset->size());
  recording.config = mapper_config(mapper, dataset->suggested_sensor());
  recording.labelled = dataset->has_labels(0);
  recording.read = [dataset](std::size_t i) { return dataset->read(i); };
  for (const StampedPose& pose : *truth) recording.truth.push_back(pose.T_map_lidar);
  return recording;
}

/// A mapper that takes part, and its clock.
struct WeightingRun {
  WeightingRun(const std::string& weighting_name, MapperConfig config, bool labelled)
      : weighting(weighting_name) {
    config.odometry.weighting = weighting_from_name(weighting_name);
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

}  // namespace

GroundTruthSequence open_ground_truth_sequence(const std::string& name, std::size_t max_scans,
                                               const MapperArguments& mapper,
                                               const SimulationArguments& simulation) {
  if (name.starts_with(simulated)) return open_simulated(name, max_scans, mapper, simulation);
  return open_dataset(name, max_scans, mapper);
}

std::vector<WeightingResult> compare_weightings(const GroundTruthSequence& recording,
                                                const std::function<bool(std::size_t)>& scan_done) {
  std::vector<WeightingRun> runs;
  for (const char* weighting_name : weighting_names) {
    runs.emplace_back(weighting_name, recording.config, recording.labelled);
  }
  for (std::size_t i = 0; i < recording.scans; ++i) {
    const DatasetFrame frame = recording.read(i);
    for (WeightingRun& run : runs) run.map(frame.scan, recording.name);
    if (!scan_done(i + 1)) break;
  }
  std::vector<WeightingResult> results;
  for (const WeightingRun& run : runs) {
    results.push_back(run.result(recording.truth));
  }
  return results;
}

}  // namespace stillmap::cli
