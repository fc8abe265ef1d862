#include <pybind11/stl.h>

#include <array>
#include <chrono>
#include <mutex>

#include "clients/python/bindings.hpp"
#include "clients/python/traversability.hpp"
#include "config/loaders/robot_profile.hpp"
#include "core/planning/path_planner.hpp"
#include "core/traversability/traversability_map.hpp"

namespace stillmap::python {
namespace {

void require_answer(TraversabilityStatus status, const std::string& reason) {
  if (status == TraversabilityStatus::ok) return;
  if (status == TraversabilityStatus::not_found) {
    PyErr_SetString(PyExc_LookupError, reason.c_str());
    throw py::error_already_set();
  }
  throw std::invalid_argument(reason);
}

template <typename Scalar, typename Value>
py::array_t<Scalar> cells_of(const TraversabilityAnswer& answer, Value value) {
  py::array_t<Scalar> array({answer.grid.height, answer.grid.width});
  Scalar* to = array.mutable_data();
  for (const TraversabilityCellInfo& cell : answer.cells) *to++ = static_cast<Scalar>(value(cell));
  return array;
}

Goal goal_from(const std::vector<double>& place, const char* name) {
  if (place.size() < 2 || place.size() > 3) {
    throw std::invalid_argument(std::string(name) + " must be (x, y) or (x, y, heading_rad)");
  }
  return {{place[0], place[1]}, place.size() == 3 ? std::optional(place[2]) : std::nullopt};
}

py::object plan_result(const PathPlan& plan) {
  py::array_t<double> poses({static_cast<py::ssize_t>(plan.poses.size()), py::ssize_t{3}});
  std::vector<double> heights;
  for (py::ssize_t i = 0; const PlannedPose& planned : plan.poses) {
    poses.mutable_at(i, 0) = planned.pose.position_map.x();
    poses.mutable_at(i, 1) = planned.pose.position_map.y();
    poses.mutable_at(i++, 2) = planned.pose.heading_rad;
    heights.push_back(planned.height_m);
  }
  py::dict fields;
  fields["is_found"] = plan.is_found();
  fields["status"] = std::string(name(plan.status));
  fields["reason"] = plan.reason;
  fields["poses_map"] = poses;
  fields["height_m"] = array_of<double>(std::move(heights));
  fields["length_m"] = plan.length_m;
  fields["clearance_m"] = plan.clearance_m;
  fields["cost"] = plan.cost;
  fields["map_version"] = plan.map_version;
  return namespace_of(fields);
}

py::object plan(const Traversability& where, const std::vector<double>& start,
                const std::vector<double>& goal, double time_limit_s, std::uint32_t seed) {
  const auto from = goal_from(start, "start"), to = goal_from(goal, "goal");
  PathPlan found;
  {
    // One at a time in a process, as OMPL's random seed is one.
    static std::mutex planning;
    const py::gil_scoped_release released;
    const std::scoped_lock lock(planning);
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(time_limit_s);
    PlanningConfig config;
    config.seed = seed;
    config.should_stop = [&] { return std::chrono::steady_clock::now() > end; };
    found = plan_path(*where.view, from, to, config);
  }
  if (found.status == PlanStatus::invalid_request) throw std::invalid_argument(found.reason);
  return plan_result(found);
}

constexpr const char* plan_help =
    "Plans a path of the robot's footprint. start, goal: (x, y) or (x, y, heading_rad), map frame "
    "[m]. The answer has is_found, status, reason, poses_map (n, 3: x, y, heading), height_m (n,; "
    "NaN where the ground is unknown), "
    "length_m, clearance_m, cost. Threads plan one after the other.";

}  // namespace

Traversability traversability_of(const MapSnapshot& view, const std::string& robot) {
  const RobotProfile profile = load_robot_profile(robot);
  TraversabilityMap map({profile});
  static_cast<void>(map.update(view));
  return {map.view(profile.name)};
}

py::object grid_of(const TraversabilityAnswer& answer) {
  const OccupancyGrid& grid = answer.grid;
  require_answer(grid.status, grid.reason);
  py::dict fields;
  py::array_t<std::int8_t> data({grid.height, grid.width});
  std::ranges::copy(grid.data, data.mutable_data());
  fields["cost"] = data;
  fields["state"] = cells_of<std::uint8_t>(answer, [](const auto& cell) { return cell.state; });
  fields["reason"] = cells_of<std::uint8_t>(answer, [](const auto& cell) { return cell.reason; });
  fields["is_inferred"] = cells_of<bool>(answer, [](const auto& cell) { return cell.inferred; });
  fields["ground_z_m"] = cells_of<float>(answer, [](const auto& cell) { return cell.ground_z_m; });
  fields["origin_map"] = py::make_tuple(grid.origin_map.x(), grid.origin_map.y());
  fields["resolution_m"] = grid.resolution_m;
  fields["map_version"] = grid.map_version;
  return namespace_of(fields);
}

py::object nearest_of(const NearestTraversable& nearest) {
  require_answer(nearest.status, nearest.reason);
  py::dict fields;
  fields["position_map"] =
      py::make_tuple(nearest.position_map.x(), nearest.position_map.y(), nearest.height_m);
  fields["distance_m"] = nearest.distance_m;
  fields["map_version"] = nearest.map_version;
  return namespace_of(fields);
}

py::object check_of(const PathCheck& check) {
  require_answer(check.status, check.reason);
  py::dict fields;
  fields["is_free"] = check.is_free;
  fields["clearance_m"] = check.clearance_m;
  fields["checked_m"] = check.checked_m;
  fields["map_version"] = check.map_version;
  fields["reason"] = py::none();
  fields["conflict_map"] = py::none();
  if (check.conflict) {
    fields["reason"] = std::string(name(check.conflict->reason));
    fields["conflict_map"] =
        py::make_tuple(check.conflict->pose.position_map.x(), check.conflict->pose.position_map.y(),
                       check.conflict->pose.heading_rad);
  }
  return namespace_of(fields);
}

PathQuery path_query_from(const InArray<double>& positions_map,
                          const std::optional<InArray<double>>& headings_rad) {
  PathQuery query;
  query.positions_map = positions_from(positions_map, "positions_map");
  query.headings_rad = values_from(headings_rad, "headings_rad", query.positions_map.size());
  return query;
}

void bind_traversability(py::module_& module) {
  py::list states, reasons;
  for (int i = 0; i < 3; ++i) states.append(std::string(name(static_cast<CellState>(i))));
  for (std::size_t i = 0; i < block_reason_count; ++i) {
    reasons.append(std::string(name(static_cast<BlockReason>(i))));
  }
  module.attr("CELL_STATES") = py::tuple(states);
  module.attr("BLOCK_REASONS") = py::tuple(reasons);
  py::class_<Traversability>(module, "Traversability", "Where one robot can go on one map.")
      .def(
          "grid",
          [](const Traversability& where, const Region& region) {
            TraversabilityAnswer answer;
            {
              const py::gil_scoped_release released;
              TraversabilityQuery query;
              query.region = region;
              answer = query_traversability(*where.view, query);
            }
            return grid_of(answer);
          },
          py::arg("region") = BoxRegion{},
          "Cells of a region in plan, (rows, columns), row 0 at the lowest y: cost int8 (-1 "
          "unknown, 0..98 free, 99 inscribed, 100 lethal), state (index of CELL_STATES), reason "
          "(of BLOCK_REASONS), is_inferred, ground_z_m float32 (NaN: unknown); origin_map: lowest "
          "corner [m], resolution_m. Raises LookupError outside of the map.")
      .def(
          "nearest",
          [](const Traversability& where, double x_m, double y_m, double max_distance_m) {
            return nearest_of(nearest_traversable(*where.view, {x_m, y_m}, max_distance_m));
          },
          py::arg("x_m"), py::arg("y_m"), py::arg("max_distance_m") = 100.0,
          "The free cell nearest to a place of the map frame.")
      .def(
          "check_path",
          [](const Traversability& where, const InArray<double>& positions_map,
             const std::optional<InArray<double>>& headings_rad) {
            return check_of(check_path(*where.view, path_query_from(positions_map, headings_rad)));
          },
          py::arg("positions_map"), py::arg("headings_rad") = py::none(),
          "Whether the robot can follow a path, or the first place where it cannot. positions_map: "
          "(n, 2), map frame [m].")
      .def("plan", &plan, py::arg("start"), py::arg("goal"), py::arg("time_limit_s") = 2.0,
           py::arg("seed") = 1, plan_help);
}

}  // namespace stillmap::python
