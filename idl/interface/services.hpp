#pragma once

#include <string>
#include <string_view>
#include <tuple>

#include "localize.h"
#include "nav_msgs.h"
#include "octomap_msgs.h"
#include "removed_voxels.h"
#include "stillmap_msgs.h"
#include "stillmap_occupancy.h"
#include "traversability.h"

namespace stillmap::dds {

/// What a service does to the server.
enum class ServiceEffect {
  reads,
  /// Changes, saves or replaces the map: planners may not call it.
  modifies,
};

/// A ROS 2 service: its types, its name, and what it does.
template <typename RequestType, typename ReplyType>
struct ServiceSpec {
  using Request = RequestType;
  using Reply = ReplyType;

  /// Last part of the name.
  std::string_view name;
  ServiceEffect effect;

  /// The effect has no default: a row that forgot it would let planners change the map.
  consteval ServiceSpec(std::string_view last_part, ServiceEffect what_it_does)
      : name(last_part), effect(what_it_does) {}

  /// Its ROS 2 name in a server's name space: "stillmap/get_status".
  [[nodiscard]] std::string in(std::string_view name_space) const {
    return std::string(name_space).append("/").append(name);
  }
};

/// Whether this request of the service may change something: of those that can look alone, only
/// where they are told to apply what they find.
template <typename Request, typename Reply>
[[nodiscard]] bool asks_for_change(const ServiceSpec<Request, Reply>& spec,
                                   const Request& request) {
  if (spec.effect == ServiceEffect::reads) return false;
  if constexpr (requires { request.apply(); }) {
    return request.apply();
  } else {
    return true;
  }
}

/// The table of services: the server's handlers, the client, the roles and the fuzz target of
/// requests go through it.
namespace services {

namespace srv = stillmap_msgs::srv;
using nav_msgs::srv::GetMap_Request;
using nav_msgs::srv::GetMap_Response;
using octomap_msgs::srv::GetOctomap_Request;
using octomap_msgs::srv::GetOctomap_Response;
using enum ServiceEffect;

inline constexpr ServiceSpec<srv::GetStaticMap_Request, srv::GetStaticMap_Response> get_static_map{
    "get_static_map", reads};
inline constexpr ServiceSpec<srv::GetTileVersions_Request, srv::GetTileVersions_Response>
    get_tile_versions{"get_tile_versions", reads};
inline constexpr ServiceSpec<srv::GetTiles_Request, srv::GetTiles_Response> get_tiles{"get_tiles",
                                                                                      reads};
inline constexpr ServiceSpec<srv::GetStatus_Request, srv::GetStatus_Response> get_status{
    "get_status", reads};
inline constexpr ServiceSpec<srv::SaveMap_Request, srv::SaveMap_Response> save_map{"save_map",
                                                                                   modifies};
inline constexpr ServiceSpec<srv::LoadMap_Request, srv::LoadMap_Response> load_map{"load_map",
                                                                                   modifies};
inline constexpr ServiceSpec<srv::Reset_Request, srv::Reset_Response> reset{"reset", modifies};
/// As octomap_server names them.
inline constexpr ServiceSpec<GetOctomap_Request, GetOctomap_Response> octomap_binary{
    "octomap_binary", reads};
inline constexpr ServiceSpec<GetOctomap_Request, GetOctomap_Response> octomap_full{"octomap_full",
                                                                                   reads};
inline constexpr ServiceSpec<srv::QueryOccupancy_Request, srv::QueryOccupancy_Response>
    query_occupancy{"query_occupancy", reads};
inline constexpr ServiceSpec<srv::GetRemoved_Request, srv::GetRemoved_Response> get_removed{
    "get_removed", reads};
inline constexpr ServiceSpec<srv::RestoreRemoved_Request, srv::RestoreRemoved_Response>
    restore_removed{"restore_removed", modifies};
inline constexpr ServiceSpec<srv::GetTraversableArea_Request, srv::GetTraversableArea_Response>
    get_traversable_area{"get_traversable_area", reads};
inline constexpr ServiceSpec<srv::CheckPath_Request, srv::CheckPath_Response> check_path{
    "check_path", reads};
inline constexpr ServiceSpec<srv::NearestTraversable_Request, srv::NearestTraversable_Response>
    nearest_traversable{"nearest_traversable", reads};
/// It may set the robot somewhere else.
inline constexpr ServiceSpec<srv::Localize_Request, srv::Localize_Response> localize{"localize",
                                                                                     modifies};
/// The traversability grid, as Nav2 asks for maps.
inline constexpr ServiceSpec<GetMap_Request, GetMap_Response> get_map{"get_map", reads};

inline constexpr std::tuple all{get_static_map,
                                get_tile_versions,
                                get_tiles,
                                get_status,
                                save_map,
                                load_map,
                                reset,
                                octomap_binary,
                                octomap_full,
                                query_occupancy,
                                get_removed,
                                restore_removed,
                                get_traversable_area,
                                check_path,
                                nearest_traversable,
                                localize,
                                get_map};

}  // namespace services

/// Calls visit(spec) for each service.
template <typename Visit>
void for_each_service(Visit&& visit) {
  std::apply([&](const auto&... spec) { (visit(spec), ...); }, services::all);
}

}  // namespace stillmap::dds
