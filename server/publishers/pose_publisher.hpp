#pragma once

#include <string>

#include "config/server_config.hpp"
#include "idl/dds/writer.hpp"
#include "idl/topics.hpp"
#include "nav_msgs.h"
#include "tf2_msgs.h"

namespace stillmap {

/// Publishes each pose as odometry and as the transform map -> lidar. (A map -> odom -> base chain
/// needs the robot's own odometry; until then the lidar hangs from the map directly.) The mapper's
/// thread calls it: two small writes.
class PosePublisher {
 public:
  PosePublisher(Participant& participant, const Topics& topics, const FramesConfig& frames);

  void publish(std::int64_t stamp_ns, const OdometryResult& odometry,
               const std::string& lidar_frame);

 private:
  std::string map_frame_;
  Writer<nav_msgs::msg::Odometry> odometry_;
  Writer<tf2_msgs::msg::TFMessage> tf_;
};

}  // namespace stillmap
