#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "clients/commands/mapping/mapping_run.hpp"
#include "clients/commands/mapping/trajectory_report.hpp"
#include "clients/terminal/json.hpp"

namespace stillmap::cli {

/// Results of a mapping run, with its errors where the sequence has true poses.
struct MapOutput {
  std::filesystem::path folder;
  /// What the poses are of.
  std::string frame;
  /// The lidar that the scans were taken for, and what said so (see sensor_origin()).
  std::string sensor;
  std::string sensor_origin;
  /// What of the recording was not read, in words.
  std::vector<std::string> recording_faults;
  std::optional<TrajectoryReport> accuracy;
  /// Before loops were closed.
  std::optional<TrajectoryReport> odometry_accuracy;
};

/// Name of the file with KITTI's form of the poses.
[[nodiscard]] std::string pose_file_of(const std::string& frame);

/// Where a drive or a map was put onto another map.
[[nodiscard]] Json to_json(const SessionReport& session);
/// Contents of report.json.
[[nodiscard]] Json to_json(const MappingResult& result, const MapOutput& output);
/// Throws DatasetWriteError.
void write_report(const std::filesystem::path& file, const Json& report);
/// The same for people, shorter.
[[nodiscard]] std::string describe(const MappingResult& result, const MapOutput& output);

}  // namespace stillmap::cli
