#pragma once

#include <string>
#include <utility>

#include "clients/library/client.hpp"
#include "idl/conversions/map_query.hpp"
#include "idl/dds/service_client.hpp"
#include "idl/interface/topics.hpp"
#include "nav_msgs.h"
#include "octomap_msgs.h"
#include "removed_voxels.h"
#include "stillmap_msgs.h"
#include "stillmap_occupancy.h"
#include "traversable_area.h"

namespace stillmap {

/// Of an answer that makes no sense.
[[nodiscard]] ServiceError malformed_reply(const std::string& service);

/// The client's participant and its ends of the services.
struct Client::Connection {
  explicit Connection(const ClientOptions& client_options);

  /// The server's reply; throws ServiceTimeout when there is none, which tells of what was `waited`
  /// before, too.
  template <typename Request, typename Reply>
  [[nodiscard]] Reply call(dds::ServiceClient<Request, Reply>& service, const std::string& name,
                           Request request, std::chrono::milliseconds timeout,
                           std::chrono::milliseconds waited = {}) {
    if constexpr (requires { request.format_version(dds::wire_format_version); }) {
      request.format_version(dds::wire_format_version);
    }
    if (!service.refusal().empty()) throw ServiceError(name + ": " + service.refusal());
    auto reply = service.call(request, timeout);
    if (!reply) {
      throw timeout_error(name, timeout + waited,
                          service.wait_for_server(std::chrono::milliseconds(0)));
    }
    return *std::move(reply);
  }

  /// As `call` within the usual time; throws ServiceError when the server refuses.
  template <typename Request, typename Reply>
  [[nodiscard]] Reply call_ok(dds::ServiceClient<Request, Reply>& service, const std::string& name,
                              Request request) {
    Reply reply = call(service, name, std::move(request), options.request_timeout);
    if (reply.status().code() != static_cast<std::uint8_t>(wire::ReplyCode::ok)) {
      throw ServiceError(name + " was refused: " + reply.status().reason());
    }
    return reply;
  }

  /// These tiles with their voxels, in as many requests as the server's answers need.
  [[nodiscard]] TileSet fetch_tiles(std::span<const TileId> ids);

  [[nodiscard]] ServiceTimeout timeout_error(const std::string& name,
                                             std::chrono::milliseconds timeout, bool found) const;

  ClientOptions options;
  /// When the client that it is for began to look for the server.
  std::chrono::steady_clock::time_point connecting_since = std::chrono::steady_clock::now();
  dds::Topics topics;
  dds::Services names;
  dds::Participant participant;
  dds::ServiceClient<stillmap_msgs::srv::GetStaticMap_Request,
                     stillmap_msgs::srv::GetStaticMap_Response>
      get_static_map;
  dds::ServiceClient<stillmap_msgs::srv::GetTileVersions_Request,
                     stillmap_msgs::srv::GetTileVersions_Response>
      get_tile_versions;
  dds::ServiceClient<stillmap_msgs::srv::GetTiles_Request, stillmap_msgs::srv::GetTiles_Response>
      get_tiles;
  dds::ServiceClient<stillmap_msgs::srv::GetStatus_Request, stillmap_msgs::srv::GetStatus_Response>
      get_status;
  dds::ServiceClient<stillmap_msgs::srv::SaveMap_Request, stillmap_msgs::srv::SaveMap_Response>
      save_map;
  dds::ServiceClient<stillmap_msgs::srv::LoadMap_Request, stillmap_msgs::srv::LoadMap_Response>
      load_map;
  dds::ServiceClient<stillmap_msgs::srv::Reset_Request, stillmap_msgs::srv::Reset_Response> reset;
  using GetOctomap = dds::ServiceClient<octomap_msgs::srv::GetOctomap_Request,
                                        octomap_msgs::srv::GetOctomap_Response>;
  GetOctomap octomap_binary;
  GetOctomap octomap_full;
  dds::ServiceClient<stillmap_msgs::srv::QueryOccupancy_Request,
                     stillmap_msgs::srv::QueryOccupancy_Response>
      query_occupancy;
  dds::ServiceClient<stillmap_msgs::srv::GetTraversableArea_Request,
                     stillmap_msgs::srv::GetTraversableArea_Response>
      get_traversable_area;
  dds::ServiceClient<stillmap_msgs::srv::CheckPath_Request, stillmap_msgs::srv::CheckPath_Response>
      check_path;
  dds::ServiceClient<stillmap_msgs::srv::NearestTraversable_Request,
                     stillmap_msgs::srv::NearestTraversable_Response>
      nearest_traversable;
  dds::ServiceClient<stillmap_msgs::srv::GetRemoved_Request,
                     stillmap_msgs::srv::GetRemoved_Response>
      get_removed;
  dds::ServiceClient<stillmap_msgs::srv::RestoreRemoved_Request,
                     stillmap_msgs::srv::RestoreRemoved_Response>
      restore_removed;
  dds::ServiceClient<nav_msgs::srv::GetMap_Request, nav_msgs::srv::GetMap_Response> get_map;
};

}  // namespace stillmap
