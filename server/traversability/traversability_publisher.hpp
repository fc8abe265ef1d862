#pragma once

#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "server/monitoring/throttled_log.hpp"
#include "server/traversability/traversability_grid.hpp"

namespace stillmap::server {

/// Publishes the traversability grid whenever it changed. One thread calls it.
class TraversabilityPublisher {
 public:
  TraversabilityPublisher(dds::Participant& participant, const dds::Topics& topics,
                          const TraversabilityGridProvider& grid_provider);

  void publish();

 private:
  const TraversabilityGridProvider& grid_provider_;
  OccupancyGrid published_;
  ThrottledLog throttled_log_;
  dds::Writer<nav_msgs::msg::OccupancyGrid> writer_;
};

}  // namespace stillmap::server
