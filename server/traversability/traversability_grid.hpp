#pragma once

#include <string>

#include "config/loaders/server_config.hpp"
#include "core/traversability/occupancy_grid.hpp"
#include "nav_msgs.h"
#include "server/publishers/latest_map.hpp"
#include "server/traversability/traversability_snapshot.hpp"

namespace stillmap::server {

/// The area of one robot as Nav2 knows maps. Thread-safe.
class TraversabilityGridProvider {
 public:
  TraversabilityGridProvider(const TraversabilityConfig& areas, const std::string& map_frame,
                             const LatestMap& latest_map,
                             const TraversabilitySnapshot& traversability);

  /// As of the last update. Its status is not ok without a robot, a map, or a window on the map,
  /// or when it would be too large; the reason names what would do.
  [[nodiscard]] OccupancyGrid grid() const;
  /// The same with the newest scan's stamp; of no size when the status is not ok.
  [[nodiscard]] nav_msgs::msg::OccupancyGrid message(const OccupancyGrid& grid) const;

 private:
  [[nodiscard]] TraversabilityRegion window() const;

  std::string profile_;
  double window_m_;
  std::string map_frame_;
  const LatestMap& latest_map_;
  const TraversabilitySnapshot& traversability_;
};

}  // namespace stillmap::server
