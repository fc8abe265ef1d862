#pragma once

#include <tuple>

#include "idl/interface/services.hpp"
#include "server/services/service_context.hpp"

namespace stillmap::server {

namespace srv = stillmap_msgs::srv;

/// A region of the static map, in pages. All pages of an answer show the map as it was at the
/// first.
[[nodiscard]] srv::GetStaticMap_Response get_static_map(const ServiceContext& context,
                                                        const srv::GetStaticMap_Request& request);
/// Releases the maps of answers whose next page was not asked for in time.
void drop_expired_pages(const ServiceContext& context);
/// Revision and hash of every tile whose footprint meets a box.
[[nodiscard]] srv::GetTileVersions_Response get_tile_versions(
    const ServiceContext& context, const srv::GetTileVersions_Request& request);
/// Tiles by id, up to a few megabytes an answer.
[[nodiscard]] srv::GetTiles_Response get_tiles(const ServiceContext& context,
                                               const srv::GetTiles_Request& request);

[[nodiscard]] srv::GetStatus_Response get_status(const ServiceContext& context,
                                                 const srv::GetStatus_Request& request);
[[nodiscard]] srv::SaveMap_Response save_map(const ServiceContext& context,
                                             const srv::SaveMap_Request& request);
[[nodiscard]] srv::LoadMap_Response load_map(const ServiceContext& context,
                                             const srv::LoadMap_Request& request);
/// Starts an empty map and trajectory.
[[nodiscard]] srv::Reset_Response reset(const ServiceContext& context,
                                        const srv::Reset_Request& request);

/// The octree; without name and data when the server keeps none, or it is not made yet.
[[nodiscard]] octomap_msgs::srv::GetOctomap_Response octomap_binary(
    const ServiceContext& context, const octomap_msgs::srv::GetOctomap_Request& request);
[[nodiscard]] octomap_msgs::srv::GetOctomap_Response octomap_full(
    const ServiceContext& context, const octomap_msgs::srv::GetOctomap_Request& request);
/// Points, boxes and rays of one request.
[[nodiscard]] srv::QueryOccupancy_Response query_occupancy(
    const ServiceContext& context, const srv::QueryOccupancy_Request& request);

/// What is kept out of the static map in a region.
[[nodiscard]] srv::GetRemoved_Response get_removed(const ServiceContext& context,
                                                   const srv::GetRemoved_Request& request);
/// Shows again what was removed in a box.
[[nodiscard]] srv::RestoreRemoved_Response restore_removed(
    const ServiceContext& context, const srv::RestoreRemoved_Request& request);

/// Where a robot can go in a region: a grid with reasons, and outlines.
[[nodiscard]] srv::GetTraversableArea_Response get_traversable_area(
    const ServiceContext& context, const srv::GetTraversableArea_Request& request);
/// Whether a robot can follow a path, or the first position where it cannot.
[[nodiscard]] srv::CheckPath_Response check_path(const ServiceContext& context,
                                                 const srv::CheckPath_Request& request);
/// The free cell nearest to a position.
[[nodiscard]] srv::NearestTraversable_Response nearest_traversable(
    const ServiceContext& context, const srv::NearestTraversable_Request& request);
/// Where the server's last scan is in its map; can set the robot there.
[[nodiscard]] srv::Localize_Response localize(const ServiceContext& context,
                                              const srv::Localize_Request& request);
/// The traversability grid as Nav2 asks for maps; of no size when there is none.
[[nodiscard]] nav_msgs::srv::GetMap_Response get_map(const ServiceContext& context,
                                                     const nav_msgs::srv::GetMap_Request& request);

/// Which answers may take processor time from the mapper.
enum class AnswerUrgency {
  /// None: they are long, or nobody waits for them to move on.
  background,
  /// Those that planners wait for, as long as all of them take little (PromptBudget).
  prompt,
};

/// What answers a service.
template <typename Request, typename Reply>
struct ServiceHandler {
  dds::ServiceSpec<Request, Reply> spec;
  Reply (*answer)(const ServiceContext& context, const Request& request);
  AnswerUrgency urgency = AnswerUrgency::background;
  /// Called once a second while there are no requests, never beside `answer`.
  void (*idle)(const ServiceContext& context) = [](const ServiceContext&) {};
};
template <typename Request, typename Reply, typename... Rest>
ServiceHandler(dds::ServiceSpec<Request, Reply>, Rest...) -> ServiceHandler<Request, Reply>;

/// A handler for every service.
inline constexpr std::tuple service_handlers{
    ServiceHandler{dds::services::get_static_map, get_static_map, AnswerUrgency::prompt,
                   drop_expired_pages},
    ServiceHandler{dds::services::get_tile_versions, get_tile_versions, AnswerUrgency::prompt},
    ServiceHandler{dds::services::get_tiles, get_tiles, AnswerUrgency::prompt},
    ServiceHandler{dds::services::get_status, get_status, AnswerUrgency::prompt},
    ServiceHandler{dds::services::save_map, save_map},
    ServiceHandler{dds::services::load_map, load_map},
    ServiceHandler{dds::services::reset, reset},
    ServiceHandler{dds::services::octomap_binary, octomap_binary},
    ServiceHandler{dds::services::octomap_full, octomap_full},
    ServiceHandler{dds::services::query_occupancy, query_occupancy, AnswerUrgency::prompt},
    ServiceHandler{dds::services::get_removed, get_removed},
    ServiceHandler{dds::services::restore_removed, restore_removed},
    ServiceHandler{dds::services::get_traversable_area, get_traversable_area,
                   AnswerUrgency::prompt},
    ServiceHandler{dds::services::check_path, check_path, AnswerUrgency::prompt},
    ServiceHandler{dds::services::nearest_traversable, nearest_traversable, AnswerUrgency::prompt},
    ServiceHandler{dds::services::localize, localize},
    ServiceHandler{dds::services::get_map, get_map}};
static_assert(std::tuple_size_v<decltype(service_handlers)> ==
                  std::tuple_size_v<decltype(dds::services::all)>,
              "a service without a handler, or a handler whose service is not in the table");

/// Calls visit(handler) for each service.
template <typename Visit>
void for_each_handler(Visit&& visit) {
  std::apply([&](const auto&... handler) { (visit(handler), ...); }, service_handlers);
}

}  // namespace stillmap::server
