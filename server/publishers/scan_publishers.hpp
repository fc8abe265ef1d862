#pragma once

#include <memory>
#include <string>

#include "config/loaders/server_config.hpp"
#include "core/lidar/labelled_scan.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "nav_msgs.h"
#include "sensor_msgs.h"
#include "server/threads/worker.hpp"
#include "tf2_msgs.h"

namespace stillmap::server {

/// Publishes each pose as odometry and as the transform map -> lidar. (A map -> odom -> base chain
/// needs the robot's own odometry; until then the lidar hangs from the map directly.) It writes
/// from a thread of its own: a socket buffer that a slow network has filled blocks this thread,
/// never the mapper. What waits when it is destroyed is written first.
class PosePublisher {
 public:
  PosePublisher(dds::Participant& participant, const dds::Topics& topics,
                const FramesConfig& frames);

  /// Returns at once. When a thousand poses wait, the oldest is dropped, as in the topic's history.
  void publish(std::int64_t stamp_ns, const OdometryResult& odometry,
               const std::string& lidar_frame);

 private:
  struct Message {
    nav_msgs::msg::Odometry odometry;
    tf2_msgs::msg::TFMessage tf;
  };

  void write(const Message& message);

  std::string map_frame_;
  dds::Writer<nav_msgs::msg::Odometry> odometry_;
  dds::Writer<tf2_msgs::msg::TFMessage> tf_;
  BoundedQueue<Message> queue_;
  // Last: stops before what it uses is gone.
  Worker<Message> worker_;
};

/// Publishes labelled scans from a thread of its own; while one is being written, only the newest
/// of the next ones is kept.
class LabelledScanPublisher {
 public:
  LabelledScanPublisher(dds::Participant& participant, const dds::Topics& topics);

  /// Returns at once.
  void publish(std::shared_ptr<const LabelledScan> labelled, const std::string& lidar_frame);

 private:
  struct Message {
    std::shared_ptr<const LabelledScan> labelled;
    std::string lidar_frame;
  };

  void write(const Message& message);

  dds::Writer<sensor_msgs::msg::PointCloud2> writer_;
  BoundedQueue<Message> newest_{1};
  // Last: stops before what it uses is gone.
  Worker<Message> worker_;
};

}  // namespace stillmap::server
