#include "clients/commands/query/octomap_report.hpp"

#include <nlohmann/json.hpp>
#include <sstream>

#include "clients/terminal/table.hpp"
#include "core/occupancy/occupancy_map.hpp"

namespace stillmap::cli {
namespace {

std::string place(const Eigen::Vector3d& p) {
  return fixed(p.x(), 2) + ", " + fixed(p.y(), 2) + ", " + fixed(p.z(), 2);
}

std::string outcome(const PointOccupancy& point) {
  if (!point.fault.empty()) return "cannot be asked: " + point.fault;
  return std::string(name(point.occupancy)) + " (probability " + fixed(point.probability, 2) + ")";
}

std::string outcome(const BoxOccupancy& box) {
  if (!box.fault.empty()) return "cannot be asked: " + box.fault;
  return std::to_string(box.occupied) + " voxels occupied, " + std::to_string(box.free) +
         " free, " + std::to_string(box.unknown) + " unknown";
}

std::string outcome(const RayOccupancy& ray) {
  if (!ray.fault.empty()) return "cannot be asked: " + ray.fault;
  const std::string where = fixed(ray.length_m, 2) + " m, at " + place(ray.end_map);
  if (ray.end == Occupancy::occupied) return "hits after " + where;
  if (ray.end == Occupancy::unknown) return "enters unknown space after " + where;
  return "is free for " + where;
}

nlohmann::json coordinates(const Eigen::Vector3d& p) {
  return nlohmann::json::array({p.x(), p.y(), p.z()});
}

nlohmann::json with_fault(nlohmann::json answer, const std::string& fault) {
  return fault.empty() ? std::move(answer) : nlohmann::json{{"fault", fault}};
}

nlohmann::json one(const PointOccupancy& point) {
  return with_fault({{"occupancy", name(point.occupancy)}, {"probability", point.probability}},
                    point.fault);
}

nlohmann::json one(const BoxOccupancy& box) {
  nlohmann::json voxels = nlohmann::json::array();
  for (const auto& voxel_map : box.occupied_map) {
    voxels.push_back(coordinates(voxel_map.cast<double>()));
  }
  return with_fault({{"occupied", box.occupied},
                     {"free", box.free},
                     {"unknown", box.unknown},
                     {"occupied_voxels", voxels}},
                    box.fault);
}

nlohmann::json one(const RayOccupancy& ray) {
  return with_fault(
      {{"end", name(ray.end)}, {"length_m", ray.length_m}, {"end_point", coordinates(ray.end_map)}},
      ray.fault);
}

template <class Answer>
nlohmann::json all(const std::vector<Answer>& answers) {
  nlohmann::json list = nlohmann::json::array();
  for (const Answer& answer : answers) list.push_back(one(answer));
  return list;
}

}  // namespace

OctomapSummary summarize(const OctomapData& data) {
  const OccupancyMap map(data);
  const double reach_m = 32766.0 * data.resolution_m;
  const Eigen::Vector3d corner = Eigen::Vector3d::Constant(reach_m);
  const BoxOccupancy all = map.in_box({-corner, corner}, 0);
  return {.resolution_m = data.resolution_m,
          .nodes = map.size().nodes,
          .occupied = all.occupied,
          .free = all.free,
          .encoded_bytes = data.bytes.size()};
}

std::string describe(const OctomapSummary& summary) {
  std::ostringstream text;
  text << summary.occupied << " voxels occupied, " << summary.free << " free, of "
       << summary.resolution_m << " m; " << summary.nodes << " nodes in " << summary.encoded_bytes
       << " bytes\n";
  return text.str();
}

nlohmann::json to_json(const OctomapSummary& summary) {
  return {{"resolution_m", summary.resolution_m},
          {"nodes", summary.nodes},
          {"occupied", summary.occupied},
          {"free", summary.free},
          {"bytes", summary.encoded_bytes}};
}

std::string describe(const OccupancyQuery& query, const OccupancyAnswers& answers) {
  std::string text;
  const auto add_line = [&](const std::string& asked, const std::string& said) {
    text.append(asked).append(": ").append(said).append("\n");
  };
  for (std::size_t i = 0; i < answers.points.size(); ++i) {
    add_line("point " + place(query.points_map[i]), outcome(answers.points[i]));
  }
  for (std::size_t i = 0; i < answers.boxes.size(); ++i) {
    const Eigen::AlignedBox3d& box_map = query.boxes_map[i];
    add_line("box " + place(box_map.min()) + " to " + place(box_map.max()),
             outcome(answers.boxes[i]));
  }
  for (std::size_t i = 0; i < answers.rays.size(); ++i) {
    add_line("ray from " + place(query.rays[i].origin_map), outcome(answers.rays[i]));
  }
  return text;
}

nlohmann::json to_json(const OccupancyAnswers& answers) {
  return {{"resolution_m", answers.resolution_m},
          {"points", all(answers.points)},
          {"boxes", all(answers.boxes)},
          {"rays", all(answers.rays)}};
}

}  // namespace stillmap::cli
