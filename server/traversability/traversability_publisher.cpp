#include "server/traversability/traversability_publisher.hpp"

#include <utility>

namespace stillmap::server {
namespace {

bool is_same_grid(const OccupancyGrid& a, const OccupancyGrid& b) {
  return a.origin_map == b.origin_map && a.resolution_m == b.resolution_m && a.width == b.width &&
         a.height == b.height && a.data == b.data;
}

}  // namespace

TraversabilityPublisher::TraversabilityPublisher(dds::Participant& participant,
                                                 const dds::Topics& topics,
                                                 const TraversabilityGridProvider& grid_provider)
    : grid_provider_(grid_provider),
      writer_(participant, topics.traversability.dds_name, topics.traversability.writer) {}

void TraversabilityPublisher::publish() {
  OccupancyGrid grid = grid_provider_.grid();
  if (grid.status == TraversabilityStatus::too_large) {
    throttled_log_.warn("grid", "no grid is published: " + grid.reason);
  }
  if (is_same_grid(grid, published_)) return;
  published_ = std::move(grid);
  // A keep-last writer always has room.
  static_cast<void>(writer_.write(grid_provider_.message(published_)));
}

}  // namespace stillmap::server
