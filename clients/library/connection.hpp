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
[[nodiscard]] ServiceError malformed(const std::string& service);

/// The client's participant and its ends of the services.
struct Client::Connection {
  explicit Connection(const ClientOptions& client_options);

  /// The server's reply; throws ServiceTimeout when there is none, which tells of what was `waited`
  /// before, too.
  template <typename Request, typename Reply>
  [[nodiscard]] Reply ask(ServiceClient<Request, Reply>& service, const std::string& name,
                          Request request, std::chrono::milliseconds timeout,
                          std::chrono::milliseconds waited = {}) {
    if constexpr (requires { request.format_version(wire_format_version); }) {
      request.format_version(wire_format_version);
    }
    if (!service.refusal().empty()) throw ServiceError(name + ": " + service.refusal());
    auto reply = service.ask(request, timeout);
    if (!reply) {
      throw no_answer(name, timeout + waited,
                      service.wait_for_server(std::chrono::milliseconds(0)));
    }
    return *std::move(reply);
  }

  /// As `ask` within the usual time; throws ServiceError when the server refuses.
  template <typename Request, typename Reply>
  [[nodiscard]] Reply ask_ok(ServiceClient<Request, Reply>& service, const std::string& name,
                             Request request) {
    Reply reply = ask(service, name, std::move(request), options.request_timeout);
    if (reply.status().code() != static_cast<std::uint8_t>(wire::ReplyCode::ok)) {
      throw ServiceError(name + " was refused: " + reply.status().reason());
    }
    return reply;
  }

  /// These tiles with their voxels, in as many requests as the server's answers need.
  [[nodiscard]] TileSet fetch_tiles(std::span<const TileId> ids);

  [[nodiscard]] ServiceTimeout no_answer(const std::string& name, std::chrono::milliseconds timeout,
                                         bool found) const;

  ClientOptions options;
  /// When the client that it is for began to look for the server.
  std::chrono::steady_clock::time_point began = std::chrono::steady_clock::now();
  Topics topics;
  Services names;
  Participant participant;
  ServiceClient<stillmap_msgs::srv::GetStaticMap_Request, stillmap_msgs::srv::GetStaticMap_Response>
      get_static_map;
  ServiceClient<stillmap_msgs::srv::GetTileVersions_Request,
                stillmap_msgs::srv::GetTileVersions_Response>
      get_tile_versions;
  ServiceClient<stillmap_msgs::srv::GetTiles_Request, stillmap_msgs::srv::GetTiles_Response>
      get_tiles;
  ServiceClient<stillmap_msgs::srv::GetStatus_Request, stillmap_msgs::srv::GetStatus_Response>
      get_status;
  ServiceClient<stillmap_msgs::srv::SaveMap_Request, stillmap_msgs::srv::SaveMap_Response> save_map;
  ServiceClient<stillmap_msgs::srv::LoadMap_Request, stillmap_msgs::srv::LoadMap_Response> load_map;
  ServiceClient<stillmap_msgs::srv::Reset_Request, stillmap_msgs::srv::Reset_Response> reset;
  using GetOctomap =
      ServiceClient<octomap_msgs::srv::GetOctomap_Request, octomap_msgs::srv::GetOctomap_Response>;
  GetOctomap octomap_binary;
  GetOctomap octomap_full;
  ServiceClient<stillmap_msgs::srv::QueryOccupancy_Request,
                stillmap_msgs::srv::QueryOccupancy_Response>
      query_occupancy;
  ServiceClient<stillmap_msgs::srv::GetTraversableArea_Request,
                stillmap_msgs::srv::GetTraversableArea_Response>
      get_traversable_area;
  ServiceClient<stillmap_msgs::srv::CheckPath_Request, stillmap_msgs::srv::CheckPath_Response>
      check_path;
  ServiceClient<stillmap_msgs::srv::NearestTraversable_Request,
                stillmap_msgs::srv::NearestTraversable_Response>
      nearest_traversable;
  ServiceClient<stillmap_msgs::srv::GetRemoved_Request, stillmap_msgs::srv::GetRemoved_Response>
      get_removed;
  ServiceClient<stillmap_msgs::srv::RestoreRemoved_Request,
                stillmap_msgs::srv::RestoreRemoved_Response>
      restore_removed;
  ServiceClient<nav_msgs::srv::GetMap_Request, nav_msgs::srv::GetMap_Response> get_map;
};

}  // namespace stillmap
