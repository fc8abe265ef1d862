#include "idl/conversions/path_query.hpp"

#include <utility>

#include "idl/conversions/traversability.hpp"
#include "idl/interface/topics.hpp"

namespace stillmap::wire {

using stillmap_msgs::srv::CheckPath_Request;
using stillmap_msgs::srv::CheckPath_Response;
using stillmap_msgs::srv::NearestTraversable_Response;

CheckPath_Request to_request(const PathQuery& query) {
  CheckPath_Request request;
  request.format_version(dds::wire_format_version);
  request.profile(query.profile);
  request.x().reserve(query.positions_map.size());
  request.y().reserve(query.positions_map.size());
  for (const Eigen::Vector2d& position : query.positions_map) {
    request.x().push_back(position.x());
    request.y().push_back(position.y());
  }
  request.heading_rad(query.headings_rad);
  return request;
}

PathQueryFromRequest from_request(const CheckPath_Request& request) {
  if (request.x().size() != request.y().size()) {
    return {{},
            "x has " + std::to_string(request.x().size()) + " values and y has " +
                std::to_string(request.y().size()) + "; give an x and a y for every position"};
  }
  PathQuery query;
  query.profile = request.profile();
  query.positions_map.reserve(request.x().size());
  for (std::size_t i = 0; i < request.x().size(); ++i) {
    query.positions_map.emplace_back(request.x()[i], request.y()[i]);
  }
  query.headings_rad = request.heading_rad();
  return {std::move(query), {}};
}

CheckPath_Response to_response(const PathCheck& check, std::uint64_t map_id) {
  CheckPath_Response response;
  response.status(to_reply_status(check.status, check.reason, check.map_version, map_id));
  response.is_free(check.is_free);
  response.clearance_m(check.clearance_m);
  response.checked_m(check.checked_m);
  response.inferred_m(check.inferred_m);
  if (!check.conflict) return response;
  const PathConflict& conflict = *check.conflict;
  response.conflict_segment(conflict.segment);
  response.conflict_along_m(conflict.along_m);
  response.conflict_x(conflict.pose.position_map.x());
  response.conflict_y(conflict.pose.position_map.y());
  response.conflict_heading_rad(conflict.pose.heading_rad);
  response.conflict_cell_x(conflict.cell_centre_map.x());
  response.conflict_cell_y(conflict.cell_centre_map.y());
  response.conflict_reason(static_cast<std::uint8_t>(conflict.reason));
  return response;
}

std::optional<PathCheck> from_response(const CheckPath_Response& response) {
  const auto status = traversability_status(response.status());
  const auto reason = block_reason(response.conflict_reason());
  if (!status || !reason) return std::nullopt;
  PathCheck check;
  check.status = *status;
  check.reason = response.status().reason();
  check.map_version = response.status().map_version();
  check.is_free = response.is_free();
  check.clearance_m = response.clearance_m();
  check.checked_m = response.checked_m();
  check.inferred_m = response.inferred_m();
  if (check.is_free || check.status != TraversabilityStatus::ok) return check;
  check.conflict = {.segment = response.conflict_segment(),
                    .along_m = response.conflict_along_m(),
                    .pose = {.position_map = {response.conflict_x(), response.conflict_y()},
                             .heading_rad = response.conflict_heading_rad()},
                    .cell_centre_map = {response.conflict_cell_x(), response.conflict_cell_y()},
                    .reason = *reason};
  return check;
}

NearestTraversable_Response to_response(const NearestTraversable& nearest, std::uint64_t map_id) {
  NearestTraversable_Response response;
  response.status(to_reply_status(nearest.status, nearest.reason, nearest.map_version, map_id));
  response.x(nearest.position_map.x());
  response.y(nearest.position_map.y());
  response.ground_z(nearest.height_m);
  response.distance_m(nearest.distance_m);
  response.cost(nearest.cell.cost);
  response.inferred(nearest.cell.inferred);
  response.clearance_m(nearest.cell.clearance_m);
  return response;
}

std::optional<NearestTraversable> from_response(const NearestTraversable_Response& response) {
  const auto status = traversability_status(response.status());
  if (!status) return std::nullopt;
  NearestTraversable nearest;
  nearest.status = *status;
  nearest.reason = response.status().reason();
  nearest.map_version = response.status().map_version();
  if (nearest.status != TraversabilityStatus::ok) return nearest;
  nearest.position_map = {response.x(), response.y()};
  nearest.height_m = response.ground_z();
  nearest.distance_m = response.distance_m();
  nearest.cell.state = CellState::free;
  nearest.cell.cost = response.cost();
  nearest.cell.inferred = response.inferred();
  nearest.cell.clearance_m = static_cast<float>(response.clearance_m());
  return nearest;
}

}  // namespace stillmap::wire
