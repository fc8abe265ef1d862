#include "idl/conversions/map_query.hpp"

#include <utility>
#include <vector>

#include "idl/conversions/tile.hpp"
#include "idl/topics.hpp"

namespace stillmap::wire {

using stillmap_msgs::srv::GetStaticMap_Request;
using stillmap_msgs::srv::GetStaticMap_Response;

stillmap_msgs::msg::ReplyStatus to_reply_status(ReplyCode code, const std::string& reason,
                                                std::uint64_t map_version, std::uint64_t map_id) {
  stillmap_msgs::msg::ReplyStatus status;
  status.code(static_cast<std::uint8_t>(code));
  status.reason(reason);
  status.map_version(map_version);
  status.map_id(map_id);
  return status;
}

std::optional<std::string> version_fault(std::uint8_t format_version) {
  if (format_version == wire_format_version) return std::nullopt;
  return "format_version is " + std::to_string(format_version) + "; this server speaks " +
         std::to_string(wire_format_version);
}

GetStaticMap_Request to_request(const MapQuery& query) {
  GetStaticMap_Request request;
  request.format_version(wire_format_version);
  const auto& low = query.box_map.min();
  const auto& high = query.box_map.max();
  request.min_x(low.x());
  request.min_y(low.y());
  request.min_z(low.z());
  request.max_x(high.x());
  request.max_y(high.y());
  request.max_z(high.z());
  std::vector<std::uint8_t> classes;
  classes.reserve(query.classes.size());
  for (std::uint8_t label = 0; label < query.classes.size(); ++label) {
    if (query.classes[label]) classes.push_back(label);
  }
  request.classes(std::move(classes));
  request.resolution_m(query.resolution_m);
  request.max_bytes(query.max_bytes);
  request.continuation(query.continuation);
  return request;
}

QueryFromRequest from_request(const GetStaticMap_Request& request) {
  if (const auto fault = version_fault(request.format_version())) return {{}, *fault};
  MapQuery query;
  query.box_map.min() = {request.min_x(), request.min_y(), request.min_z()};
  query.box_map.max() = {request.max_x(), request.max_y(), request.max_z()};
  for (const std::uint8_t label : request.classes()) {
    if (label >= semantic_class_count) {
      return {{}, "classes contains " + std::to_string(label) + "; classes are 0..19"};
    }
    query.classes.set(label);
  }
  query.resolution_m = request.resolution_m();
  query.max_bytes = request.max_bytes();
  query.continuation = request.continuation();
  return {query, {}};
}

GetStaticMap_Response to_response(const MapQueryResult& result) {
  GetStaticMap_Response response;
  response.status(to_reply_status(static_cast<ReplyCode>(result.status), result.reason,
                                  result.map_version, result.map_id));
  auto& voxels = response.voxels();
  resize(voxels, result.voxels.size());
  for (std::size_t i = 0; i < result.voxels.size(); ++i) {
    const QueryVoxel& voxel = result.voxels[i];
    voxels.x()[i] = voxel.position_map.x();
    voxels.y()[i] = voxel.position_map.y();
    voxels.z()[i] = voxel.position_map.z();
    voxels.label()[i] = static_cast<std::uint8_t>(voxel.label);
    voxels.confidence()[i] = voxel.confidence;
    voxels.point_count()[i] = voxel.point_count;
  }
  response.total_voxels(result.total_voxels);
  response.continuation(result.continuation);
  return response;
}

std::optional<MapQueryResult> from_response(const GetStaticMap_Response& response) {
  const auto& status = response.status();
  const auto& voxels = response.voxels();
  if (status.code() > static_cast<std::uint8_t>(QueryStatus::stale_continuation) ||
      !consistent(voxels)) {
    return std::nullopt;
  }
  MapQueryResult result;
  result.status = static_cast<QueryStatus>(status.code());
  result.reason = status.reason();
  result.map_version = status.map_version();
  result.map_id = status.map_id();
  result.total_voxels = response.total_voxels();
  result.continuation = response.continuation();
  result.voxels.reserve(voxels.x().size());
  for (std::size_t i = 0; i < voxels.x().size(); ++i) {
    result.voxels.push_back({.position_map = {voxels.x()[i], voxels.y()[i], voxels.z()[i]},
                             .label = static_cast<SemanticClass>(voxels.label()[i]),
                             .confidence = voxels.confidence()[i],
                             .point_count = voxels.point_count()[i]});
  }
  return result;
}

}  // namespace stillmap::wire
