#include <utility>

#include "clients/library/connection.hpp"
#include "core/occupancy/octomap_data.hpp"
#include "idl/conversions/occupancy_query.hpp"
#include "idl/conversions/octomap.hpp"

namespace stillmap {

OctomapData Client::octomap(bool full) {
  const std::string& name =
      full ? connection_->names.octomap_full : connection_->names.octomap_binary;
  auto& service = full ? connection_->octomap_full : connection_->octomap_binary;
  const auto timeout = connection_->options.request_timeout;
  const auto reply = service.call(octomap_msgs::srv::GetOctomap_Request(), timeout);
  if (!reply) {
    throw connection_->timeout_error(name, timeout,
                                     service.wait_for_server(std::chrono::milliseconds(0)));
  }
  // The standard's reply has no place for a reason.
  if (reply->map().id().empty()) {
    throw ServiceError(name +
                       " has no octree: the server's configuration has occupancy.enabled false");
  }
  auto data = wire::from_octomap(reply->map());
  if (!data || data->binary == full || !check_octomap(*data).fault.empty())
    throw malformed_reply(name);
  return *std::move(data);
}

OccupancyAnswers Client::query_occupancy(const OccupancyQuery& query) {
  const std::string& name = connection_->names.query_occupancy;
  const auto reply =
      connection_->call_ok(connection_->query_occupancy, name, wire::to_request(query));
  auto answers = wire::from_response(reply);
  if (!answers || answers->points.size() != query.points_map.size() ||
      answers->boxes.size() != query.boxes_map.size() ||
      answers->rays.size() != query.rays.size()) {
    throw malformed_reply(name);
  }
  return *std::move(answers);
}

}  // namespace stillmap
