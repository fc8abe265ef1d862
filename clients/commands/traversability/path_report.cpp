#include "clients/commands/traversability/path_report.hpp"

#include <nlohmann/json.hpp>

#include "clients/terminal/table.hpp"

namespace stillmap::cli {
namespace {

std::string at(const Eigen::Vector2d& position_map) {
  std::string text = "(";
  return text.append(fixed(position_map.x(), 2))
      .append(", ")
      .append(fixed(position_map.y(), 2))
      .append(")");
}

nlohmann::json conflict_json(const PathConflict& conflict) {
  return {{"segment", conflict.segment},
          {"along_m", conflict.along_m},
          {"pose",
           {{"x", conflict.pose.position_map.x()},
            {"y", conflict.pose.position_map.y()},
            {"heading_rad", conflict.pose.heading_rad}}},
          {"place", {conflict.cell_centre_map.x(), conflict.cell_centre_map.y()}},
          {"reason", name(conflict.reason)}};
}

std::string inferred_part(double inferred_m) {
  if (inferred_m == 0.0) return {};
  std::string text = ", ";
  return text.append(fixed(inferred_m, 1)).append(" m of it on inferred ground");
}

}  // namespace

nlohmann::json to_json(const PathCheck& check, const std::string& profile) {
  nlohmann::json json = {{"profile", profile},
                         {"status", name(check.status)},
                         {"free", check.is_free},
                         {"clearance_m", check.clearance_m},
                         {"checked_m", check.checked_m},
                         {"inferred_m", check.inferred_m},
                         {"map_version", check.map_version}};
  if (!check.reason.empty()) json["reason"] = check.reason;
  if (check.conflict) json["conflict"] = conflict_json(*check.conflict);
  return json;
}

std::string describe(const PathCheck& check, const std::string& profile) {
  if (check.status != TraversabilityStatus::ok) return "not known: " + check.reason + "\n";
  if (!check.conflict) {
    return "free for " + profile + ": " + fixed(check.checked_m, 1) + " m, clearance " +
           fixed(check.clearance_m, 2) + " m" + inferred_part(check.inferred_m) + "\n";
  }
  const PathConflict& conflict = *check.conflict;
  return "blocked for " + profile + " after " + fixed(conflict.along_m, 1) +
         " m: " + std::string(name(conflict.reason)) + " at " + at(conflict.cell_centre_map) +
         ", touched by the robot at " + at(conflict.pose.position_map) + " with heading " +
         fixed(conflict.pose.heading_rad, 2) + " rad, after position " +
         std::to_string(conflict.segment) + "\n";
}

nlohmann::json to_json(const NearestTraversable& nearest, const std::string& profile) {
  nlohmann::json json = {
      {"profile", profile}, {"status", name(nearest.status)}, {"map_version", nearest.map_version}};
  if (nearest.status != TraversabilityStatus::ok) {
    json["reason"] = nearest.reason;
    return json;
  }
  json["position"] = {nearest.position_map.x(), nearest.position_map.y(), nearest.height_m};
  json["distance_m"] = nearest.distance_m;
  json["cost"] = nearest.cell.cost;
  json["inferred"] = nearest.cell.inferred;
  json["clearance_m"] = nearest.cell.clearance_m;
  return json;
}

std::string describe(const NearestTraversable& nearest, const std::string& profile) {
  if (nearest.status != TraversabilityStatus::ok) return nearest.reason + "\n";
  return at(nearest.position_map) + " is free for " + profile + ", " +
         fixed(nearest.distance_m, 2) + " m away; ground at " + fixed(nearest.height_m, 2) + " m" +
         (nearest.cell.inferred ? " (inferred)" : "") + ", cost " +
         std::to_string(nearest.cell.cost) + " of 98, clearance " +
         fixed(nearest.cell.clearance_m, 2) + " m\n";
}

}  // namespace stillmap::cli
