#pragma once

#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "server/traversability/traversability_grid_provider.hpp"
#include "server/monitoring/throttled_log.hpp"

namespace stillmap {

/// Publishes the planning grid whenever it changed. One thread calls it.
class AreaPublisher {
 public:
  AreaPublisher(Participant& participant, const Topics& topics, const PlanningGrid& planning_grid);

  void publish();

 private:
  const PlanningGrid& planning_grid_;
  OccupancyGrid published_;
  RareWarnings warnings_;
  Writer<nav_msgs::msg::OccupancyGrid> writer_;
};

}  // namespace stillmap
