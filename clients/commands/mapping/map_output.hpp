#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "clients/commands/mapping/mapping_run.hpp"
#include "clients/commands/mapping/trajectory_report.hpp"

namespace stillmap::cli {

/// Results of a mapping run, with its errors where the recording brings the truth.
struct MapOutput {
  std::filesystem::path folder;
  std::optional<TrajectoryReport> accuracy;
};

/// Name of the map file in an output folder.
[[nodiscard]] std::filesystem::path map_file_in(const std::filesystem::path& folder);

/// Makes the folder. Throws std::invalid_argument when it holds a map already and `force` is not
/// set; with `force`, removes that map.
void prepare_output_folder(const std::filesystem::path& folder, bool force);

/// Writes poses_lidar.txt, poses_tum.txt, map.stillmap, map.ply, map.pcd, map.png and, with truth,
/// trajectory.png and trajectory_error.png. Throws what their writers throw.
[[nodiscard]] MapOutput write_map_output(const std::filesystem::path& folder,
                                         const ScanDataset& dataset, const MappingResult& result,
                                         const MapperConfig& config);

/// Everything that can be said about the run, as report.json has it.
[[nodiscard]] nlohmann::json to_json(const MappingResult& result, const MapOutput& output);
/// The same for people, shorter.
[[nodiscard]] std::string describe(const MappingResult& result, const MapOutput& output);

}  // namespace stillmap::cli
