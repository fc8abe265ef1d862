#pragma once

#include <cstdint>
#include <exception>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

#include "core/map/query/tile_reader.hpp"
#include "core/map/tile.hpp"
#include "idl/conversions/map_query.hpp"
#include "idl/interface/server_status.hpp"
#include "server/mapping/map_saver.hpp"
#include "server/mapping/mapping_thread.hpp"
#include "server/monitoring/service_log.hpp"
#include "server/occupancy/occupancy_thread.hpp"
#include "server/publishers/latest_map.hpp"
#include "server/services/paged_snapshots.hpp"
#include "server/traversability/traversability_grid.hpp"
#include "server/traversability/traversability_snapshot.hpp"

namespace stillmap::server {

/// What the services answer from. Everything may be called from several threads at once.
struct ServiceContext {
  const LatestMap& latest_map;
  /// Reads tiles that are not in memory.
  TileReader& tiles;
  MapSaver& saver;
  std::function<dds::ServerStatus()> status;
  /// For the saver: how a new map, or one that was saved, takes the running one's place.
  MapSaver::BeginMap begin_map;
  MapSaver::PrepareMap prepare_map;
  /// Publishes what was mapped until now.
  std::function<void()> publish_now;
  /// What is kept out of the static map.
  std::function<RemovedInBox(const Eigen::AlignedBox3d& box_map)> removed;
  /// Returns how many voxels are shown again.
  std::function<std::size_t(RemovalReason reason, const Eigen::AlignedBox3d& box_map)>
      restore_removed;
  /// Where the last scan is in the map.
  std::function<LocalizationAnswer(const LocalizationQuestion&)> localize;
  /// Both are empty when the server keeps no octree.
  std::function<OccupancyAnswers(const OccupancyQuery&)> query_occupancy;
  std::function<EncodedOctree(OctomapEncoding encoding)> encode_octomap;
  const TraversabilityCache& traversability;
  const TraversabilityGridProvider& grid_provider;
  std::string map_frame;
  ServiceLog& log;
  /// A client that wants more gets more pages of get_static_map.
  std::uint32_t max_page_bytes = 8'000'000;
  /// Used by get_static_map alone, by one thread at a time.
  std::shared_ptr<PagedSnapshots> paged_snapshots = std::make_shared<PagedSnapshots>();
};

/// Status of a reply about this view.
[[nodiscard]] inline stillmap_msgs::msg::ReplyStatus reply_status(
    const MapSnapshot& view, wire::ReplyCode code = wire::ReplyCode::ok,
    const std::string& reason = {}) {
  return wire::to_reply_status(code, reason, view.version, view.map_id);
}

/// The reply that `fill` completes, or one that says why not: a format version that is not ours, or
/// what `fill` threw.
template <typename Reply, typename Request, typename Fill>
[[nodiscard]] Reply answer(const ServiceContext& context, const Request& request, Fill fill) {
  Reply reply;
  const auto view = context.latest_map.view();
  if (const auto fault = wire::version_fault(request.format_version())) {
    reply.status(reply_status(*view, wire::ReplyCode::invalid_request, *fault));
    return reply;
  }
  try {
    reply.status(reply_status(*view));
    fill(*view, reply);
  } catch (const TileChanged& fault) {
    reply.status(reply_status(*view, wire::ReplyCode::stale_continuation, fault.what()));
  } catch (const std::invalid_argument& fault) {
    reply.status(reply_status(*view, wire::ReplyCode::invalid_request, fault.what()));
  } catch (const std::exception& fault) {
    reply.status(reply_status(*view, wire::ReplyCode::failed, fault.what()));
  }
  return reply;
}

}  // namespace stillmap::server
