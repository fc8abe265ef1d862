#include "clients/commands/planning/plan_report.hpp"

#include <cmath>
#include <fstream>
#include <stdexcept>

#include "clients/commands/pose_report.hpp"
#include "clients/terminal/json.hpp"
#include "clients/terminal/table.hpp"
#include "core/process/file_beside.hpp"

namespace stillmap::cli {
namespace {

Json pose_json(const PlannedPose& pose) {
  return {{"x_m", pose.pose.position_map.x()},
          {"y_m", pose.pose.position_map.y()},
          {"z_m", pose.height_m},
          {"heading_deg", heading_deg(pose.pose)},
          {"along_m", pose.along_m},
          {"reverse", pose.is_reverse}};
}

/// Empty where the ground is unknown.
std::string height(const PlannedPose& pose, int decimals) {
  return std::isfinite(pose.height_m) ? fixed(pose.height_m, decimals) : std::string();
}

/// Poses some metres apart, and both ends.
std::string pose_table(const PathPlan& plan) {
  constexpr double max_rows = 20.0;
  const double spacing_m = std::max(1.0, plan.length_m / max_rows);
  Table table({"along m", "x", "y", "z", "heading deg", "gear"});
  double next_m = 0.0;
  for (const PlannedPose& pose : plan.poses) {
    if (pose.along_m < next_m && &pose != &plan.poses.back()) continue;
    next_m = pose.along_m + spacing_m;
    table.add({fixed(pose.along_m, 1), fixed(pose.pose.position_map.x(), 2),
               fixed(pose.pose.position_map.y(), 2), height(pose, 2),
               fixed(heading_deg(pose.pose), 0), pose.is_reverse ? "reverse" : "forward"});
  }
  return table.text();
}

std::string figures(const TimedPlan& timed) {
  const PathPlan& plan = timed.plan;
  std::string text = fixed(plan.length_m, 1) + " m";
  if (plan.reverse_m > 0.05) text += ", " + fixed(plan.reverse_m, 1) + " m of it backwards";
  if (plan.inferred_m > 0.05) text += ", " + fixed(plan.inferred_m, 1) + " m on inferred ground";
  return text + ", clearance " + fixed(plan.clearance_m, 1) + " m, cost " + fixed(plan.cost, 1);
}

std::string times(const TimedPlan& timed) {
  std::string text = "planned in " + fixed(timed.plan_ms, 0) + " ms";
  if (timed.first_ms) text += " (a first path after " + fixed(*timed.first_ms, 0) + " ms)";
  return text + ", traversability in " + fixed(timed.traversability_ms, 0) + " ms";
}

void write_csv(std::ostream& out, const PathPlan& plan) {
  out << "x_m,y_m,z_m,heading_deg,along_m,reverse\n";
  for (const PlannedPose& pose : plan.poses) {
    out << fixed(pose.pose.position_map.x(), 3) << ',' << fixed(pose.pose.position_map.y(), 3)
        << ',' << height(pose, 3) << ',' << fixed(heading_deg(pose.pose), 2) << ','
        << fixed(pose.along_m, 3) << ',' << (pose.is_reverse ? 1 : 0) << '\n';
  }
}

}  // namespace

Json to_json(const TimedPlan& timed, bool with_poses) {
  const PathPlan& plan = timed.plan;
  Json json{{"status", name(plan.status)},
            {"reason", plan.reason},
            {"length_m", plan.length_m},
            {"reverse_m", plan.reverse_m},
            {"inferred_m", plan.inferred_m},
            {"clearance_m", plan.clearance_m},
            {"cost", plan.cost},
            {"route_m", plan.route_m},
            {"iterations", plan.steps},
            {"map_version", plan.map_version},
            {"poses", plan.poses.size()},
            {"traversability_ms", timed.traversability_ms},
            {"plan_ms", timed.plan_ms}};
  if (timed.first_ms) json.set("first_ms", *timed.first_ms);
  if (!timed.cause.empty()) json.set("cause", timed.cause);
  if (plan.nearby) {
    json.set("nearby_m", {plan.nearby->position_map.x(), plan.nearby->position_map.y()});
  }
  if (with_poses) {
    Json path = Json::array();
    for (const PlannedPose& pose : plan.poses) path.push_back(pose_json(pose));
    json.set("path", std::move(path));
  }
  return json;
}

std::string describe(const TimedPlan& timed) {
  std::string text;
  if (!timed.cause.empty()) text += "planned again: " + timed.cause + "\n";
  if (!timed.plan.is_found()) {
    return text + std::string(name(timed.plan.status)) + ": " + timed.plan.reason + "\n";
  }
  return text + pose_table(timed.plan) + figures(timed) + "\n" + times(timed) + "\n";
}

std::string one_line(const TimedPlan& timed) {
  const std::string what = timed.plan.is_found()
                               ? "path of " + figures(timed) + "; " + times(timed)
                               : std::string(name(timed.plan.status)) + ": " + timed.plan.reason;
  return "map version " + std::to_string(timed.plan.map_version) + ": " +
         (timed.cause.empty() ? "" : timed.cause + "; ") + what + "\n";
}

void check_plan_file(const std::filesystem::path& file) {
  if (file.extension() == ".json" || file.extension() == ".csv") return;
  throw std::invalid_argument("--output " + file.string() + ": must end in .json or .csv");
}

void write_plan(const std::filesystem::path& file, const TimedPlan& timed) {
  check_plan_file(file);
  // A reader finds a whole path, the earlier one or this.
  FileBeside beside(file);
  std::ofstream out(beside.path(), std::ios::trunc);
  if (file.extension() == ".csv") {
    write_csv(out, timed.plan);
  } else {
    out << to_json(timed, true).dump(1) << '\n';
  }
  out.close();
  if (out && !beside.put_in_place()) return;
  throw std::runtime_error(file.string() +
                           ": cannot be written; its folder must exist and be writable");
}

}  // namespace stillmap::cli
