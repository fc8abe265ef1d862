#pragma once

#include <cstdint>
#include <string>

#include "config/loaders/server_config.hpp"
#include "core/traversability/occupancy_grid.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "nav_msgs.h"
#include "server/monitoring/log.hpp"
#include "server/publishers/latest_map.hpp"
#include "server/traversability/traversability_snapshot.hpp"

namespace stillmap::server {

/// A grid, and the time at which its map frame was true.
struct StampedGrid : OccupancyGrid {
  std::int64_t stamp_ns = 0;
};

/// The traversability of one robot as an occupancy grid for Nav2. Thread-safe.
class TraversabilityGridProvider {
 public:
  TraversabilityGridProvider(const TraversabilityConfig& config, const std::string& map_frame,
                             const LatestMap& latest_map,
                             const TraversabilitySnapshot& traversability);

  /// As of the last update, with the newest scan's stamp; after a correction of the map that the
  /// update did not know, with that of its own time. Its status is not ok without a robot or a map,
  /// for a window off the map, and until the first update after another map began. Where it would
  /// be too large, it is a square round the robot instead, and the reason says so.
  [[nodiscard]] StampedGrid grid() const;
  /// Empty when the status is not ok.
  [[nodiscard]] nav_msgs::msg::OccupancyGrid message(const StampedGrid& grid) const;

 private:
  [[nodiscard]] OccupancyGrid grid_of(const TraversabilityView& view) const;
  [[nodiscard]] TraversabilityRegion window() const;
  [[nodiscard]] TraversabilityRegion square_round_robot(double edge_m) const;

  std::string profile_;
  double window_m_;
  std::string map_frame_;
  const LatestMap& latest_map_;
  const TraversabilitySnapshot& traversability_;
};

/// Publishes the traversability grid whenever it changed. One thread calls it.
class TraversabilityPublisher {
 public:
  TraversabilityPublisher(dds::Participant& participant, const dds::Topics& topics,
                          const TraversabilityGridProvider& grid_provider);

  void publish();

 private:
  const TraversabilityGridProvider& grid_provider_;
  StampedGrid published_;
  ThrottledLog throttled_log_;
  dds::Writer<nav_msgs::msg::OccupancyGrid> writer_;
};

}  // namespace stillmap::server
