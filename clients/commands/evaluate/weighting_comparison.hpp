#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "clients/commands/arguments/mapper_arguments.hpp"
#include "clients/commands/arguments/simulation_arguments.hpp"
#include "clients/commands/mapping/trajectory_report.hpp"
#include "core/dataset/scan_dataset.hpp"

namespace stillmap::cli {

/// Scans with true poses, from disk or simulated on the way.
struct GroundTruthSequence {
  std::string name;
  std::size_t scans = 0;
  MapperConfig config;
  bool labelled = false;
  std::function<DatasetFrame(std::size_t)> read;
  /// Lidar frame, one a scan.
  std::vector<Eigen::Isometry3d> truth;
};

/// Opens a recording with true poses, or "sim:PRESET". `max_scans` limits both. Throws
/// DatasetError, ConfigError or std::invalid_argument.
[[nodiscard]] GroundTruthSequence open_ground_truth_sequence(const std::string& name,
                                                             std::size_t max_scans,
                                                             const MapperArguments& mapper,
                                                             const SimulationArguments& simulation);

/// One row of the paper's Table I.
struct WeightingResult {
  std::string weighting;
  TrajectoryReport report;
  double median_ms = 0.0;
};

/// Runs the three weightings side by side on the same scans. `scan_done(seen)` returning false ends
/// it early. Throws std::runtime_error when a scan cannot be mapped.
[[nodiscard]] std::vector<WeightingResult> compare_weightings(
    const GroundTruthSequence& recording, const std::function<bool(std::size_t)>& scan_done);

}  // namespace stillmap::cli
