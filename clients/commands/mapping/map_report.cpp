#include <sys/resource.h>

#include <nlohmann/json.hpp>

#include "clients/commands/mapping/map_output.hpp"
#include "clients/terminal/table.hpp"

namespace stillmap::cli {
namespace {

double peak_memory_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;  // Linux counts kB
}

std::uint64_t voxel_count(const MapSnapshot& view) {
  std::uint64_t count = 0;
  for (const auto& tile : view.tiles) count += tile->info.voxel_count;
  return count;
}

nlohmann::json optional_number(const std::optional<double>& value) {
  return value ? nlohmann::json(*value) : nlohmann::json(nullptr);
}

nlohmann::json stages_json(const std::vector<StageDurations>& stages) {
  nlohmann::json json = nlohmann::json::object();
  for (const StageDurations& stage : stages) {
    json[stage.stage] = {{"median_ms", stage.quantile(0.5)},
                         {"p95_ms", stage.quantile(0.95)},
                         {"p99_ms", stage.quantile(0.99)}};
  }
  return json;
}

nlohmann::json skipped_json(const std::vector<SkippedScan>& skipped) {
  nlohmann::json json = nlohmann::json::array();
  for (const SkippedScan& scan : skipped) {
    json.push_back({{"scan", scan.index}, {"counter", scan.counter}, {"reason", scan.reason}});
  }
  return json;
}

std::string describe_stages(const std::vector<StageDurations>& stages) {
  Table table({"ms a scan", "median", "p95", "p99"});
  for (const StageDurations& stage : stages) {
    table.add({stage.stage, fixed(stage.quantile(0.5), 1), fixed(stage.quantile(0.95), 1),
               fixed(stage.quantile(0.99), 1)});
  }
  return table.text();
}

}  // namespace

nlohmann::json to_json(const MappingResult& result, const MapOutput& output) {
  nlohmann::json health = nlohmann::json::object();
  for (const auto& [state, count] : result.health) health[name(state)] = count;
  const StageDurations& total = result.stages.back();
  return {{"scans", result.trajectory.size()},
          {"seconds", result.seconds},
          {"stopped", result.stopped},
          {"median_ms", total.quantile(0.5)},
          {"p95_ms", total.quantile(0.95)},
          {"p99_ms", total.quantile(0.99)},
          {"stages", stages_json(result.stages)},
          {"peak_memory_mb", peak_memory_mb()},
          {"label_source", result.label_source},
          {"health", health},
          {"skipped", skipped_json(result.skipped)},
          {"tiles", result.view->tiles.size()},
          {"voxels", voxel_count(*result.view)},
          {"voxel_size_m", result.view->voxel_size_m},
          {"poses_frame", "lidar; the map is the lidar frame of the first pose"},
          {"moving_points",
           {{"precision", optional_number(result.moving.precision())},
            {"recall", optional_number(result.moving.recall())},
            {"iou", optional_number(result.moving.iou())}}},
          {"accuracy", output.accuracy ? to_json(*output.accuracy) : nlohmann::json(nullptr)},
          {"folder", output.folder.string()}};
}

std::string describe(const MappingResult& result, const MapOutput& output) {
  std::string text = describe_stages(result.stages);
  text += std::to_string(result.trajectory.size()) + " scans mapped in " +
          fixed(result.seconds, 1) + " s, " + std::to_string(result.skipped.size()) +
          " left out; labels: " + result.label_source + "; odometry";
  for (const auto& [state, count] : result.health) {
    text += std::string(" ") + name(state) + " " + std::to_string(count);
  }
  text += "\nmap: " + std::to_string(voxel_count(*result.view)) + " voxels of " +
          fixed(result.view->voxel_size_m, 2) + " m in " +
          std::to_string(result.view->tiles.size()) + " tiles; peak memory " +
          fixed(peak_memory_mb(), 0) + " MB\n";
  if (const auto recall = result.moving.recall()) {
    text += "moving points found: " + fixed(100.0 * *recall, 1) + " %, right ones among them " +
            fixed(100.0 * result.moving.precision().value_or(0.0), 1) + " %\n";
  }
  if (output.accuracy) text += "against the recording's truth:\n" + describe(*output.accuracy);
  text += "written to " + output.folder.string() +
          ": map.stillmap map.ply map.pcd map.png report.json, and poses_lidar.txt, "
          "poses_tum.txt (lidar frame; the map is the lidar frame of the first pose)\n";
  return text;
}

}  // namespace stillmap::cli
