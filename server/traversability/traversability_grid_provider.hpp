#pragma once

#include <string>

#include "config/loaders/server_config.hpp"
#include "core/traversability/occupancy_grid.hpp"
#include "nav_msgs.h"
#include "server/traversability/traversability_snapshot.hpp"
#include "server/publishers/latest_map.hpp"

namespace stillmap {

/// The area of one robot as Nav2 knows maps. Thread-safe.
class PlanningGrid {
 public:
  PlanningGrid(const AreasConfig& areas, const std::string& map_frame, const MapBoard& maps,
               const AreaBoard& board);

  /// As of the last update. Its status is not ok without a robot, a map, or a window on the map,
  /// or when it would be too large; the reason names what would do.
  [[nodiscard]] OccupancyGrid grid() const;
  /// The same with the newest scan's stamp; of no size when the status is not ok.
  [[nodiscard]] nav_msgs::msg::OccupancyGrid message(const OccupancyGrid& grid) const;

 private:
  [[nodiscard]] AreaRegion window() const;

  std::string profile_;
  double window_m_;
  std::string map_frame_;
  const MapBoard& maps_;
  const AreaBoard& board_;
};

}  // namespace stillmap
