#include "clients/commands/mapping/map_report.hpp"

#include <sys/resource.h>

#include <fstream>
#include <utility>
#include <vector>

#include "clients/commands/pose_report.hpp"
#include "clients/terminal/table.hpp"
#include "core/dataset/dataset_error.hpp"
#include "core/lidar/angle_units.hpp"

namespace stillmap::cli {
namespace {

double peak_memory_mb() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1024.0;  // Linux counts kB
}

Json optional_number(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json stages_json(const std::vector<StageDurations>& stages) {
  Json json = Json::object();
  for (const StageDurations& stage : stages) {
    json.set(stage.stage, {{"median_ms", stage.quantile(0.5)},
                           {"p95_ms", stage.quantile(0.95)},
                           {"p99_ms", stage.quantile(0.99)}});
  }
  return json;
}

Json skipped_json(const std::vector<SkippedScan>& skipped) {
  Json json = Json::array();
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

/// What both kinds of closures have; the rest is added.
template <typename Closure>
Json closure_json(const Closure& closure) {
  return {{"score", closure.upright_fit},
          {"fit", closure.fit},
          {"overlap", closure.overlap},
          {"runner_up", closure.runner_up},
          {"jump_m", closure.jump_m},
          {"refusal", closure.refusal.empty() ? Json(nullptr) : Json(closure.refusal)}};
}

Json closures_json(const std::vector<LoopClosure>& closures) {
  Json json = Json::array();
  for (const LoopClosure& closure : closures) {
    Json row = closure_json(closure);
    row.set("from_scan", closure.from_scan);
    row.set("to_scan", closure.to_scan);
    row.set("T_from_to", rows_json(closure.T_from_to));
    json.push_back(std::move(row));
  }
  return json;
}

Json map_closures_json(const std::vector<MapClosure>& closures) {
  Json json = Json::array();
  for (const MapClosure& closure : closures) {
    Json row = closure_json(closure);
    row.set("scan", closure.scan);
    row.set("T_map_lidar", rows_json(closure.T_map_lidar));
    json.push_back(std::move(row));
  }
  return json;
}

Json to_json(const GnssReport& gnss) {
  return {{"fixes", gnss.fixes},
          {"refused", gnss.refused},
          {"refusal", gnss.refusal.empty() ? Json(nullptr) : Json(gnss.refusal)},
          {"between_scans", gnss.placed},
          {"in_graph", gnss.positions.used},
          {"in_doubt", gnss.positions.in_doubt},
          {"contradict_odometry", gnss.are_refused},
          {"time_offset_s", gnss.delay.delay_s},
          {"antenna_offset_m", {gnss.delay.antenna_lidar.x(), gnss.delay.antenna_lidar.y()}},
          {"datum", gnss.datum ? Json(to_text(*gnss.datum)) : Json(nullptr)},
          {"tilt_deg", gnss.tilt_rad * deg_per_rad}};
}

Json to_json(const LoopReport& loops, const std::optional<TrajectoryReport>& odometry) {
  return {{"submaps", loops.submaps},
          {"nodes", loops.nodes},
          {"submaps_mib", loops.submap_mib},
          {"kept_scans_mib", loops.scan_log_mib},
          {"seconds", loops.seconds},
          {"max_correction_m", loops.max_correction_m},
          {"refused", closures_json(loops.refused)},
          {"gnss", loops.gnss ? to_json(*loops.gnss) : Json(nullptr)},
          {"odometry_accuracy", odometry ? to_json(*odometry) : Json(nullptr)}};
}

std::string describe(const GnssReport& gnss) {
  std::string text = "GNSS: " + std::to_string(gnss.placed) + " of " + std::to_string(gnss.fixes) +
                     " fixes lie between scans";
  if (gnss.refused > 0)
    text += ", " + std::to_string(gnss.refused) + " were refused (" + gnss.refusal + ")";
  if (gnss.delay.delay_s != 0.0) {
    text += ", their stamps are taken to be late by " + std::to_string(gnss.delay.delay_s) + " s";
  }
  if (gnss.are_refused) {
    return text +
           "; most contradict what odometry says of the way, and none corrects the map: stamps by "
           "another clock (gnss.time_offset_s), or another drive's fixes?\n";
  }
  if (!gnss.datum) return text + "; they do not tell yet where the map lies\n";
  return text + ", " + std::to_string(gnss.positions.used) + " correct the map, " +
         std::to_string(gnss.positions.in_doubt) + " of these in doubt; the map's datum is " +
         to_text(*gnss.datum) + "\n";
}

std::string describe(const LoopReport& loops, const MapOutput& output) {
  if (loops.closures.empty() && loops.max_correction_m == 0.0)
    return "loops: none closed in " + std::to_string(loops.submaps) + " submaps\n";
  std::string text = "loops: " + std::to_string(loops.closures.size()) + " closed in " +
                     std::to_string(loops.submaps) + " submaps, poses moved by up to " +
                     fixed(loops.max_correction_m, 2) + " m; " + fixed(loops.seconds, 1) + " s";
  if (output.odometry_accuracy) {
    text += "; ATE before " + fixed(output.odometry_accuracy->rigid_aligned.rmse_m, 3) +
            " m, after " + fixed(output.accuracy->rigid_aligned.rmse_m, 3) + " m";
  }
  return text + "\n";
}

std::string describe(const SessionReport& session) {
  std::string text = "onto the earlier map: " + session.alignment.in_words() + "; " +
                     fixed(session.seconds, 1) + " s";
  if (session.clock_offset_ns != 0) {
    text += "; stamps of the drive are not after the map's: in the map they are later by " +
            fixed(static_cast<double>(session.clock_offset_ns) / 1e9, 3) + " s";
  }
  return text + "\n";
}

/// "stream" is the server's word for labels that come with the scans; a network may label others.
std::string describe_labels(const std::string& source) {
  const std::string own = "stream";
  if (source != own && !source.starts_with(own + ",")) return source;
  return "the recording's own" + source.substr(own.size());
}

/// Points are told to move by their class.
bool looks_for_moving(const MappingResult& result) { return result.label_source != "none"; }

std::string describe_sensor(const MapOutput& output) {
  if (output.sensor_origin == "scans") return output.sensor + ", as the scans tell";
  return output.sensor + ", as " + (output.sensor_origin == "option" ? "--sensor" : "--config") +
         " names it";
}

}  // namespace

Json to_json(const SessionReport& session) {
  return {{"localized", session.alignment.localized},
          {"found", session.alignment.found},
          {"closures", map_closures_json(session.alignment.closures)},
          {"refused", map_closures_json(session.alignment.refused)},
          {"clock_offset_ns", session.clock_offset_ns},
          {"seconds", session.seconds}};
}

std::string pose_file_of(const std::string& frame) {
  return frame == "lidar" ? "poses_lidar.txt" : "poses_base.txt";
}

Json to_json(const MappingResult& result, const MapOutput& output) {
  Json health = Json::object();
  for (const auto& [state, count] : result.health) health.set(name(state), count);
  Json found_again = Json::array();
  for (const std::size_t scan : result.found_again_at) found_again.push_back(scan);
  Json faults = Json::array();
  for (const std::string& fault : output.recording_faults) faults.push_back(fault);
  const StageDurations& total = result.stages.back();
  const auto moving = looks_for_moving(result) ? result.moving : evaluation::MovingScore{};
  return {
      {"scans", result.trajectory.size()},
      {"seconds", result.seconds},
      {"interrupted", result.stopped},
      {"resumed_at_scan", result.resumed_at_scan ? Json(*result.resumed_at_scan) : Json(nullptr)},
      {"median_ms", total.quantile(0.5)},
      {"p95_ms", total.quantile(0.95)},
      {"p99_ms", total.quantile(0.99)},
      {"stages", stages_json(result.stages)},
      {"peak_memory_mb", peak_memory_mb()},
      {"sensor", {{"name", output.sensor}, {"told_by", output.sensor_origin}}},
      {"label_source", result.label_source},
      {"health", health},
      {"found_again_at_scans", found_again},
      {"skipped", skipped_json(result.skipped)},
      {"recording_faults", faults},
      {"tiles", result.view->tiles.size()},
      {"voxels", result.view->tiles.voxel_count()},
      {"voxel_size_m", result.view->voxel_size_m},
      {"poses_frame", output.frame + "; the map is its frame at the first pose"},
      {"moving_points",
       {{"precision", optional_number(moving.precision())},
        {"recall", optional_number(moving.recall())},
        {"iou", optional_number(moving.iou())}}},
      {"accuracy", output.accuracy ? to_json(*output.accuracy) : Json(nullptr)},
      {"closures", result.loops ? closures_json(result.loops->closures) : Json(nullptr)},
      {"loops", result.loops ? to_json(*result.loops, output.odometry_accuracy) : Json(nullptr)},
      {"onto", result.session ? to_json(*result.session) : Json(nullptr)},
      {"folder", output.folder.string()}};
}

void write_report(const std::filesystem::path& file, const Json& report) {
  std::ofstream out(file, std::ios::trunc);
  out << report.dump(2) << "\n";
  out.close();
  if (!out) throw DatasetWriteError(file, "cannot be written; check the folder and the space left");
}

std::string describe_imu(const MappingResult& result) {
  const InertialCounts& imu = result.imu;
  std::string text = "IMU: " + std::to_string(imu.samples) + " samples helped " +
                     std::to_string(imu.scans_helped) + " scans, were missing for " +
                     std::to_string(imu.scans_without_samples) + " and not believed for " +
                     std::to_string(imu.scans_not_believed);
  if (!result.levelling) return text;
  if (!result.levelling->fault.empty())
    return text + "; it does not level the map: " + result.levelling->fault;
  return text + "; it levels the map, in which the lidar leans by " +
         fixed(deg_per_rad * result.levelling->tilt_rad, 1) + " degrees at the start";
}

std::string describe(const MappingResult& result, const MapOutput& output) {
  std::string text = describe_stages(result.stages);
  text += std::to_string(result.trajectory.size()) + " scans mapped in " +
          fixed(result.seconds, 1) + " s, " + std::to_string(result.skipped.size()) +
          " skipped; lidar: " + describe_sensor(output) +
          "; labels: " + describe_labels(result.label_source) + "; odometry";
  for (const auto& [state, count] : result.health) {
    text += std::string(" ") + name(state) + " " + std::to_string(count);
  }
  if (const std::size_t times = result.found_again_at.size(); times > 0)
    text += "; lost, and found again in the whole map: " + std::to_string(times) + " x";
  if (result.imu.samples > 0) text += "; " + describe_imu(result);
  text += "\nmap: " + std::to_string(result.view->tiles.voxel_count()) + " voxels of " +
          fixed(result.view->voxel_size_m, 2) + " m in " +
          std::to_string(result.view->tiles.size()) + " tiles; peak memory " +
          fixed(peak_memory_mb(), 0) + " MB\n";
  if (!looks_for_moving(result)) {
    text +=
        "moving points: not looked for, since there are no labels; what moves leaves the map "
        "where later scans see through it\n";
  } else if (const auto recall = result.moving.recall()) {
    text += "moving points found: " + fixed(100.0 * *recall, 1) + " %, right ones among them " +
            fixed(100.0 * result.moving.precision().value_or(0.0), 1) + " %\n";
  }
  if (result.loops) text += describe(*result.loops, output);
  if (result.loops && result.loops->gnss) text += describe(*result.loops->gnss);
  if (result.session) text += describe(*result.session);
  if (output.accuracy)
    text += "against the true poses of the sequence:\n" + describe(*output.accuracy);
  text += "written to " + output.folder.string() +
          ": map.stillmap map.ply map.pcd map.png report.json, and " + pose_file_of(output.frame) +
          ", poses_tum.txt (frame '" + output.frame +
          "'; the map is its place at the first pose)\n";
  return text;
}

}  // namespace stillmap::cli
