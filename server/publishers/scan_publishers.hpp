#pragma once

#include <condition_variable>
#include <deque>
#include <mutex>
#include <string>
#include <thread>

#include "config/loaders/server_config.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "nav_msgs.h"
#include "tf2_msgs.h"

namespace stillmap::server {

/// Publishes each pose as odometry and as the transform map -> lidar. (A map -> odom -> base chain
/// needs the robot's own odometry; until then the lidar hangs from the map directly.) It writes
/// from a thread of its own: a socket that a slow network has filled holds up this thread, never
/// the mapper.
class PosePublisher {
 public:
  PosePublisher(dds::Participant& participant, const dds::Topics& topics,
                const FramesConfig& frames);
  /// Writes what is left first.
  ~PosePublisher();

  /// Returns at once. When a thousand poses wait, the oldest is dropped, as in the topic's history.
  void publish(std::int64_t stamp_ns, const OdometryResult& odometry,
               const std::string& lidar_frame);

 private:
  struct Message {
    nav_msgs::msg::Odometry odometry;
    tf2_msgs::msg::TFMessage tf;
  };

  void work(const std::stop_token& stop);

  std::string map_frame_;
  std::size_t max_queue_length_;
  dds::Writer<nav_msgs::msg::Odometry> odometry_;
  dds::Writer<tf2_msgs::msg::TFMessage> tf_;
  std::mutex mutex_;
  std::condition_variable_any changed_;
  std::deque<Message> waiting_;
  // Last: stops before what it uses is gone.
  std::jthread thread_;
};

}  // namespace stillmap::server
