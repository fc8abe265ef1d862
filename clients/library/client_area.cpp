#include "clients/library/connection.hpp"
#include "idl/conversions/occupancy_grid.hpp"
#include "idl/conversions/path_query.hpp"
#include "idl/conversions/traversability_query.hpp"

namespace stillmap {
namespace {

/// A server that failed is no answer, but an error.
template <typename Reply>
const Reply& require_not_failed(const Reply& reply, const std::string& service) {
  if (reply.status().code() == static_cast<std::uint8_t>(wire::ReplyCode::failed)) {
    throw ServiceError(service + " failed: " + reply.status().reason());
  }
  return reply;
}

template <typename Reply>
auto decode_reply(const Reply& reply, const std::string& service) {
  auto result = wire::from_response(require_not_failed(reply, service));
  if (!result) throw malformed_reply(service);
  return *std::move(result);
}

}  // namespace

TraversabilityAnswer Client::get_traversable_area(const TraversabilityQuery& query) {
  const std::string& service = connection_->names.get_traversable_area;
  return decode_reply(
      connection_->call(connection_->get_traversable_area, service, wire::to_request(query),
                        connection_->options.request_timeout),
      service);
}

PathCheck Client::check_path(const PathQuery& query) {
  const std::string& service = connection_->names.check_path;
  return decode_reply(connection_->call(connection_->check_path, service, wire::to_request(query),
                                        connection_->options.request_timeout),
                      service);
}

NearestTraversable Client::nearest_traversable(const std::string& profile,
                                               const Eigen::Vector2d& position_map,
                                               double max_distance_m) {
  const std::string& service = connection_->names.nearest_traversable;
  stillmap_msgs::srv::NearestTraversable_Request request;
  request.profile(profile);
  request.x(position_map.x());
  request.y(position_map.y());
  request.max_distance_m(max_distance_m);
  return decode_reply(connection_->call(connection_->nearest_traversable, service,
                                        std::move(request), connection_->options.request_timeout),
                      service);
}

OccupancyGrid Client::planning_grid() {
  const std::string& service = connection_->names.get_map;
  const auto reply =
      connection_->call(connection_->get_map, service, nav_msgs::srv::GetMap_Request(),
                        connection_->options.request_timeout);
  auto grid = wire::from_message(reply.map());
  if (!grid) throw malformed_reply(service);
  return *std::move(grid);
}

}  // namespace stillmap
