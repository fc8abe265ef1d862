#include <algorithm>
#include <bitset>
#include <iterator>
#include <stdexcept>
#include <string>

#include "core/map/query/region.hpp"
#include "core/map/tile_evidence.hpp"
#include "idl/conversions/region.hpp"
#include "idl/conversions/removed_voxels.hpp"
#include "server/services/service_handlers.hpp"

namespace stillmap::server {

using namespace stillmap_msgs::srv;

namespace {

constexpr std::size_t max_removed_per_reply = 300'000;

/// So many faults are the disk's, not a tile's.
constexpr std::size_t max_unreadable_tiles = 8;

/// Throws std::invalid_argument for a region with faults.
Region region_of(const stillmap_msgs::msg::Region& message) {
  auto [region, fault] = wire::from_wire(message);
  if (!region) throw std::invalid_argument(fault);
  if (std::string faults = region_faults(*region); !faults.empty()) {
    throw std::invalid_argument(faults);
  }
  return *region;
}

RemovalReason reason_of(std::uint8_t number) {
  if (const auto reason = wire::removal_reason(number)) return *reason;
  throw std::invalid_argument("reason is " + std::to_string(number) +
                              "; must be 0 (moving), 1 (semi-static), 2 (seen through) or 3 "
                              "(relabelled)");
}

using Reasons = std::bitset<removal_reason_count>;

Reasons reasons_of(const std::vector<std::uint8_t>& numbers) {
  Reasons reasons;
  for (const std::uint8_t number : numbers) {
    reasons.set(static_cast<std::size_t>(reason_of(number)));
  }
  return reasons.none() ? reasons.set() : reasons;
}

/// Adds those of tiles on disk. Returns why there may be more: tiles that cannot be read. Gives a
/// disk up that fails again and again: every further tile may take seconds.
std::string add_from_disk(const MapSnapshot& view, const Eigen::AlignedBox3d& box_map,
                          RemovedInBox& removed) {
  if (removed.tile_store == nullptr) return {};
  std::size_t unreadable = 0;
  std::string first_fault;
  for (const TileId id : removed.on_disk) {
    try {
      const TileRecord record = removed.tile_store->load(id);
      if (record.evidence == nullptr) continue;
      std::ranges::copy_if(removed_voxels(*record.evidence, view.voxel_size_m, view.tile_size_m),
                           std::back_inserter(removed.voxels), [&](const RemovedVoxel& voxel) {
                             return box_map.contains(voxel.position_map.cast<double>());
                           });
    } catch (const std::runtime_error& fault) {
      if (unreadable++ == 0) first_fault = fault.what();
      if (unreadable == max_unreadable_tiles) break;
    }
  }
  if (unreadable == 0) return {};
  const std::string count = unreadable == max_unreadable_tiles
                                ? "at least " + std::to_string(unreadable)
                                : std::to_string(unreadable);
  return count + " of the tiles cannot be read, the first: " + first_fault;
}

}  // namespace

GetRemoved_Response get_removed(const ServiceContext& context, const GetRemoved_Request& request) {
  using Response = GetRemoved_Response;
  return answer<Response>(context, request, [&](const MapSnapshot& view, Response& response) {
    const RegionShape region(region_of(request.region()));
    const Reasons reasons = reasons_of(request.reasons());
    RemovedInBox in_box = context.removed(region.bounds_map());
    const std::string incomplete = add_from_disk(view, region.bounds_map(), in_box);
    std::vector<RemovedVoxel>& removed = in_box.voxels;
    std::erase_if(removed, [&](const RemovedVoxel& voxel) {
      return !reasons.test(static_cast<std::size_t>(voxel.reason)) ||
             !region.contains(voxel.position_map.cast<double>());
    });
    // That nothing was removed must not be read from this.
    if (removed.empty() && !incomplete.empty()) throw std::runtime_error(incomplete);
    response.status(reply_status(view, wire::ReplyCode::ok, incomplete));
    response.total(removed.size());
    const std::size_t wanted = std::min<std::size_t>(request.max_voxels(), max_removed_per_reply);
    removed.resize(std::min(removed.size(), wanted));
    wire::write_removed(removed, response);
  });
}

RestoreRemoved_Response restore_removed(const ServiceContext& context,
                                        const RestoreRemoved_Request& request) {
  using Response = RestoreRemoved_Response;
  return answer<Response>(context, request, [&](const MapSnapshot&, Response& response) {
    const Region region = region_of(request.region());
    const auto* const box = std::get_if<BoxRegion>(&region);
    if (box == nullptr) throw std::invalid_argument("only a box can be restored; ask for one");
    const RegionShape shape(region);
    response.restored(context.restore_removed(reason_of(request.reason()), shape.bounds_map()));
    context.publish_now();
    response.status(reply_status(*context.latest_map.view()));
  });
}

}  // namespace stillmap::server
