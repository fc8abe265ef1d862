#include "server/traversability/traversability_publisher.hpp"

#include <utility>

namespace stillmap {
namespace {

bool shows_the_same(const OccupancyGrid& a, const OccupancyGrid& b) {
  return a.origin_map == b.origin_map && a.resolution_m == b.resolution_m && a.width == b.width &&
         a.height == b.height && a.data == b.data;
}

}  // namespace

AreaPublisher::AreaPublisher(Participant& participant, const Topics& topics,
                             const PlanningGrid& planning_grid)
    : planning_grid_(planning_grid),
      writer_(participant, topics.traversability.dds_name, topics.traversability.writer) {}

void AreaPublisher::publish() {
  OccupancyGrid grid = planning_grid_.grid();
  if (grid.status == AreaStatus::too_large) {
    warnings_.warn("grid", "no grid is published: " + grid.reason);
  }
  if (shows_the_same(grid, published_)) return;
  published_ = std::move(grid);
  // A keep-last writer always has room.
  static_cast<void>(writer_.write(planning_grid_.message(published_)));
}

}  // namespace stillmap
