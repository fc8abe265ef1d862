#include "idl/conversions/map_query.hpp"

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include "idl/conversions/region.hpp"
#include "idl/conversions/tile.hpp"
#include "idl/interface/topics.hpp"

namespace stillmap::wire {

using stillmap_msgs::srv::GetStaticMap_Request;
using stillmap_msgs::srv::GetStaticMap_Response;

namespace {

namespace changes = stillmap_msgs::msg::TileChange_Constants;
static_assert(static_cast<std::uint8_t>(TileChangeKind::appeared) == changes::APPEARED &&
              static_cast<std::uint8_t>(TileChangeKind::changed) == changes::CHANGED &&
              static_cast<std::uint8_t>(TileChangeKind::removed) == changes::REMOVED);

using Classes = std::bitset<semantic_class_count>;

std::vector<std::uint8_t> to_wire(const Classes& classes) {
  std::vector<std::uint8_t> numbers;
  for (std::uint8_t number = 0; number < classes.size(); ++number) {
    if (classes[number]) numbers.push_back(number);
  }
  return numbers;
}

/// What is wrong with the numbers; empty when each is a class.
std::string set_classes(const std::vector<std::uint8_t>& numbers, Classes& classes) {
  for (const std::uint8_t number : numbers) {
    if (number >= classes.size()) {
      return "classes contains " + std::to_string(number) + "; they are 0.." +
             std::to_string(classes.size() - 1);
    }
    classes.set(number);
  }
  return {};
}

stillmap_msgs::msg::TileChange to_wire(const TileChange& tile) {
  stillmap_msgs::msg::TileChange message;
  message.id().x(tile.id.x);
  message.id().y(tile.id.y);
  message.change(static_cast<std::uint8_t>(tile.kind));
  message.revision(tile.revision);
  message.voxel_count(tile.voxel_count);
  return message;
}

bool is_known_change(const stillmap_msgs::msg::TileChange& tile) {
  return tile.change() <= changes::REMOVED;
}

TileChange from_wire(const stillmap_msgs::msg::TileChange& message) {
  return {.id = {message.id().x(), message.id().y()},
          .kind = static_cast<TileChangeKind>(message.change()),
          .revision = message.revision(),
          .voxel_count = message.voxel_count()};
}

// Spans, since a message's accessors are calls, one for each element.
std::vector<QueryVoxel> voxels_of(const stillmap_msgs::msg::Voxels& message) {
  const std::span x(message.x()), y(message.y()), z(message.z());
  const std::span label(message.label());
  const std::span confidence(message.confidence());
  const std::span point_count(message.point_count());
  std::vector<QueryVoxel> voxels;
  voxels.reserve(x.size());
  for (std::size_t i = 0; i < x.size(); ++i) {
    voxels.push_back({.position_map = {x[i], y[i], z[i]},
                      .label = static_cast<SemanticClass>(label[i]),
                      .confidence = confidence[i],
                      .point_count = point_count[i]});
  }
  return voxels;
}

void set_voxels(std::span<const QueryVoxel> voxels, stillmap_msgs::msg::Voxels& message) {
  resize(message, voxels.size());
  const std::span x(message.x()), y(message.y()), z(message.z());
  const std::span label(message.label());
  const std::span confidence(message.confidence());
  const std::span point_count(message.point_count());
  for (std::size_t i = 0; i < voxels.size(); ++i) {
    const QueryVoxel& voxel = voxels[i];
    x[i] = voxel.position_map.x();
    y[i] = voxel.position_map.y();
    z[i] = voxel.position_map.z();
    label[i] = static_cast<std::uint8_t>(voxel.label);
    confidence[i] = voxel.confidence;
    point_count[i] = voxel.point_count;
  }
}

}  // namespace

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
  if (format_version == dds::wire_format_version) return std::nullopt;
  return "format_version is " + std::to_string(format_version) + "; this server speaks " +
         std::to_string(dds::wire_format_version);
}

GetStaticMap_Request to_request(const MapQuery& query) {
  GetStaticMap_Request request;
  request.format_version(dds::wire_format_version);
  request.region(to_wire(query.region));
  request.classes(to_wire(query.classes));
  request.resolution_m(query.resolution_m);
  request.max_bytes(query.max_bytes);
  if (query.since) {
    request.since_map_id(query.since->map_id);
    request.since_version(query.since->version);
  }
  request.continuation(query.continuation);
  return request;
}

QueryFromRequest from_request(const GetStaticMap_Request& request) {
  if (const auto fault = version_fault(request.format_version())) return {{}, *fault};
  auto [region, region_fault] = from_wire(request.region());
  if (!region) return {{}, std::move(region_fault)};
  MapQuery query;
  query.region = *std::move(region);
  if (auto fault = set_classes(request.classes(), query.classes); !fault.empty()) {
    return {{}, std::move(fault)};
  }
  query.resolution_m = request.resolution_m();
  query.max_bytes = request.max_bytes();
  if (request.since_map_id() != 0) query.since = {request.since_map_id(), request.since_version()};
  query.continuation = request.continuation();
  return {std::move(query), {}};
}

GetStaticMap_Response to_response(const MapQueryResult& result) {
  GetStaticMap_Response response;
  response.status(to_reply_status(static_cast<ReplyCode>(result.status), result.reason,
                                  result.map_version, result.map_id));
  set_voxels(result.voxels, response.voxels());
  response.total_voxels(result.total_voxels);
  for (const TileChange& tile : result.tiles) response.tiles().push_back(to_wire(tile));
  response.continuation(result.continuation);
  return response;
}

std::optional<MapQueryResult> from_response(const GetStaticMap_Response& response) {
  const auto& status = response.status();
  const auto& voxels = response.voxels();
  if (status.code() > static_cast<std::uint8_t>(QueryStatus::changes_unknown) ||
      !consistent(voxels) || !std::ranges::all_of(response.tiles(), is_known_change)) {
    return std::nullopt;
  }
  MapQueryResult result;
  result.status = static_cast<QueryStatus>(status.code());
  result.reason = status.reason();
  result.map_version = status.map_version();
  result.map_id = status.map_id();
  result.total_voxels = response.total_voxels();
  result.continuation = response.continuation();
  result.voxels = voxels_of(voxels);
  result.tiles.reserve(response.tiles().size());
  for (const auto& tile : response.tiles()) result.tiles.push_back(from_wire(tile));
  return result;
}

}  // namespace stillmap::wire
