#include "idl/conversions/traversability.hpp"

#include <algorithm>
#include <utility>

#include "idl/conversions/map_query.hpp"
#include "idl/conversions/region.hpp"
#include "idl/interface/topics.hpp"
#include "traversability.h"

namespace stillmap::wire {

using stillmap_msgs::srv::GetTraversableArea_Request;
using stillmap_msgs::srv::GetTraversableArea_Response;

namespace {

namespace grid_codes = stillmap_msgs::msg::TraversabilityGrid_Constants;
static_assert(static_cast<std::uint8_t>(CellState::unknown) == grid_codes::STATE_UNKNOWN &&
              static_cast<std::uint8_t>(CellState::free) == grid_codes::STATE_FREE &&
              static_cast<std::uint8_t>(CellState::lethal) == grid_codes::STATE_LETHAL);
static_assert(occupancy_lethal == grid_codes::COST_LETHAL &&
              occupancy_inscribed == grid_codes::COST_INSCRIBED &&
              static_cast<std::uint8_t>(occupancy_unknown) == grid_codes::COST_UNKNOWN);
static_assert(static_cast<std::uint8_t>(BlockReason::none) == grid_codes::REASON_NONE &&
              static_cast<std::uint8_t>(BlockReason::obstacle) == grid_codes::REASON_OBSTACLE &&
              static_cast<std::uint8_t>(BlockReason::low_headroom) ==
                  grid_codes::REASON_LOW_HEADROOM &&
              static_cast<std::uint8_t>(BlockReason::step) == grid_codes::REASON_STEP &&
              static_cast<std::uint8_t>(BlockReason::slope) == grid_codes::REASON_SLOPE &&
              static_cast<std::uint8_t>(BlockReason::roughness) == grid_codes::REASON_ROUGHNESS &&
              static_cast<std::uint8_t>(BlockReason::ground_class) ==
                  grid_codes::REASON_GROUND_CLASS &&
              static_cast<std::uint8_t>(BlockReason::inscribed) == grid_codes::REASON_INSCRIBED &&
              static_cast<std::uint8_t>(BlockReason::unknown) == grid_codes::REASON_UNKNOWN);

ReplyCode code_of(TraversabilityStatus status) {
  switch (status) {
    case TraversabilityStatus::ok:
      return ReplyCode::ok;
    case TraversabilityStatus::invalid_request:
      return ReplyCode::invalid_request;
    case TraversabilityStatus::too_large:
      return ReplyCode::too_large;
    case TraversabilityStatus::not_found:
      return ReplyCode::not_found;
  }
  return ReplyCode::failed;
}

stillmap_msgs::msg::TraversableRing to_wire(const TraversableRing& ring) {
  stillmap_msgs::msg::TraversableRing message;
  for (const Eigen::Vector2d& corner : ring) {
    message.x().push_back(corner.x());
    message.y().push_back(corner.y());
  }
  return message;
}

std::optional<TraversableRing> from_wire(const stillmap_msgs::msg::TraversableRing& message) {
  if (message.x().size() != message.y().size()) return std::nullopt;
  TraversableRing ring;
  ring.reserve(message.x().size());
  for (std::size_t i = 0; i < message.x().size(); ++i) {
    ring.emplace_back(message.x()[i], message.y()[i]);
  }
  return ring;
}

stillmap_msgs::msg::TraversablePolygon to_wire(const TraversablePolygon& polygon) {
  stillmap_msgs::msg::TraversablePolygon message;
  message.outer(to_wire(polygon.outer));
  for (const TraversableRing& hole : polygon.holes) message.holes().push_back(to_wire(hole));
  return message;
}

std::optional<TraversablePolygon> from_wire(const stillmap_msgs::msg::TraversablePolygon& message) {
  auto outer = from_wire(message.outer());
  if (!outer) return std::nullopt;
  TraversablePolygon polygon{.outer = *std::move(outer), .holes = {}};
  for (const auto& hole_message : message.holes()) {
    auto hole = from_wire(hole_message);
    if (!hole) return std::nullopt;
    polygon.holes.push_back(*std::move(hole));
  }
  return polygon;
}

void fill(const TraversabilityAnswer& answer, stillmap_msgs::msg::TraversabilityGrid& message) {
  const OccupancyGrid& grid = answer.grid;
  message.origin_x(grid.origin_map.x());
  message.origin_y(grid.origin_map.y());
  message.resolution_m(grid.resolution_m);
  message.width(grid.width);
  message.height(grid.height);
  message.cost().assign(grid.data.begin(), grid.data.end());
  const std::size_t cells = answer.cells.size();
  message.state().resize(cells);
  message.reason().resize(cells);
  message.inferred().resize(cells);
  message.ground_z().resize(cells);
  for (std::size_t i = 0; i < cells; ++i) {
    const TraversabilityCellInfo& cell = answer.cells[i];
    message.state()[i] = static_cast<std::uint8_t>(cell.state);
    message.reason()[i] = static_cast<std::uint8_t>(cell.reason);
    message.inferred()[i] = cell.inferred ? 1 : 0;
    message.ground_z()[i] = cell.ground_z_m;
  }
}

/// All arrays are of one length: none, or that of the grid.
bool is_consistent(const stillmap_msgs::msg::TraversabilityGrid& message) {
  const std::size_t cells = message.cost().size();
  const bool has_shape = std::uint64_t{message.width()} * message.height() == cells;
  return (cells == 0 || has_shape) && message.state().size() == cells &&
         message.reason().size() == cells && message.inferred().size() == cells &&
         message.ground_z().size() == cells;
}

std::optional<TraversabilityCellInfo> cell_of(const stillmap_msgs::msg::TraversabilityGrid& message,
                                              std::size_t i) {
  const auto state = cell_state(message.state()[i]);
  const auto reason = block_reason(message.reason()[i]);
  if (!state || !reason) return std::nullopt;
  return TraversabilityCellInfo{.state = *state,
                                .reason = *reason,
                                .inferred = message.inferred()[i] != 0,
                                .ground_z_m = message.ground_z()[i]};
}

/// False when the message makes no sense.
bool read_grid(const stillmap_msgs::msg::TraversabilityGrid& message,
               TraversabilityAnswer& answer) {
  if (!is_consistent(message)) return false;
  OccupancyGrid& grid = answer.grid;
  grid.origin_map = {message.origin_x(), message.origin_y()};
  grid.resolution_m = message.resolution_m();
  grid.width = message.width();
  grid.height = message.height();
  grid.data.assign(message.cost().begin(), message.cost().end());
  answer.cells.reserve(grid.data.size());
  for (std::size_t i = 0; i < grid.data.size(); ++i) {
    const auto cell = cell_of(message, i);
    if (!cell) return false;
    answer.cells.push_back(*cell);
  }
  return true;
}

}  // namespace

stillmap_msgs::msg::ReplyStatus to_reply_status(TraversabilityStatus status,
                                                const std::string& reason,
                                                std::uint64_t map_version, std::uint64_t map_id) {
  return to_reply_status(code_of(status), reason, map_version, map_id);
}

std::optional<TraversabilityStatus> traversability_status(
    const stillmap_msgs::msg::ReplyStatus& status) {
  for (const TraversabilityStatus candidate :
       {TraversabilityStatus::ok, TraversabilityStatus::invalid_request,
        TraversabilityStatus::too_large, TraversabilityStatus::not_found}) {
    if (status.code() == static_cast<std::uint8_t>(code_of(candidate))) return candidate;
  }
  return std::nullopt;
}

std::optional<CellState> cell_state(std::uint8_t number) {
  if (number > static_cast<std::uint8_t>(CellState::lethal)) return std::nullopt;
  return static_cast<CellState>(number);
}

std::optional<BlockReason> block_reason(std::uint8_t number) {
  if (number >= block_reason_count) return std::nullopt;
  return static_cast<BlockReason>(number);
}

GetTraversableArea_Request to_request(const TraversabilityQuery& query) {
  GetTraversableArea_Request request;
  request.format_version(dds::wire_format_version);
  request.profile(query.profile);
  request.region(to_wire(query.region));
  request.include_grid(query.include_grid);
  request.include_outlines(query.include_outlines);
  request.max_cells(
      static_cast<std::uint32_t>(std::min<std::uint64_t>(query.max_cells, max_answered_cells)));
  request.min_outline_area_m2(query.min_outline_area_m2);
  return request;
}

TraversabilityQueryFromRequest from_request(const GetTraversableArea_Request& request) {
  auto [region, fault] = from_wire(request.region());
  if (!region) return {{}, std::move(fault)};
  TraversabilityQuery query;
  query.profile = request.profile();
  query.region = *std::move(region);
  query.include_grid = request.include_grid();
  query.include_outlines = request.include_outlines();
  query.max_cells = max_answered_cells;
  if (request.max_cells() != 0) query.max_cells = std::min(max_answered_cells, request.max_cells());
  query.min_outline_area_m2 = request.min_outline_area_m2();
  return {std::move(query), {}};
}

GetTraversableArea_Response to_response(const TraversabilityAnswer& answer) {
  GetTraversableArea_Response response;
  response.status(to_reply_status(answer.grid.status, answer.grid.reason, answer.grid.map_version,
                                  answer.map_id));
  fill(answer, response.grid());
  for (const TraversablePolygon& outline : answer.outlines) {
    response.outlines().push_back(to_wire(outline));
  }
  return response;
}

std::optional<TraversabilityAnswer> from_response(const GetTraversableArea_Response& response) {
  const auto status = traversability_status(response.status());
  if (!status) return std::nullopt;
  TraversabilityAnswer answer;
  if (!read_grid(response.grid(), answer)) return std::nullopt;
  answer.grid.status = *status;
  answer.grid.reason = response.status().reason();
  answer.grid.map_version = response.status().map_version();
  answer.map_id = response.status().map_id();
  for (const auto& message : response.outlines()) {
    auto outline = from_wire(message);
    if (!outline) return std::nullopt;
    answer.outlines.push_back(*std::move(outline));
  }
  return answer;
}

}  // namespace stillmap::wire
