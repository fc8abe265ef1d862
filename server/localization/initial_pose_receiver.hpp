#pragma once

#include <string>

#include "idl/dds/reader.hpp"
#include "initial_pose.h"
#include "server/localization/place_finder.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/monitoring/unreadable_samples.hpp"
#include "server/threads/periodic_worker.hpp"

namespace stillmap::server {

/// Receives where an operator says that the robot is, as RViz2 and Nav2 do, and has it looked for
/// there. What cannot be used is counted ("initial_poses_refused") and logged with the reason.
class InitialPoseReceiver {
 public:
  /// `map_frame` is the only frame that a pose may be in. All must outlive it.
  InitialPoseReceiver(dds::Participant& participant, const std::string& ros_topic,
                      std::string map_frame, PlaceFinder& finder, Statistics& statistics);

 private:
  void take(const geometry_msgs::msg::PoseWithCovarianceStamped& message);
  void refuse(const std::string& why);

  std::string map_frame_;
  PlaceFinder& finder_;
  Statistics& statistics_;
  ThrottledLog throttled_log_;
  UnreadableSamples unreadable_;
  dds::Reader<geometry_msgs::msg::PoseWithCovarianceStamped> reader_;
  // Last: stops before what it uses is gone.
  PeriodicWorker worker_;
};

}  // namespace stillmap::server
