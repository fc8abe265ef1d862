#pragma once

#include "idl/dds/writer.hpp"
#include "idl/topics.hpp"
#include "server/planning_grid.hpp"
#include "server/rare_warnings.hpp"

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
