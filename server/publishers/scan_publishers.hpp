#pragma once

#include <memory>
#include <optional>
#include <string>

#include "config/loaders/server_config.hpp"
#include "core/frames/frame_tree.hpp"
#include "core/frames/odom_frame.hpp"
#include "core/lidar/labelled_scan.hpp"
#include "idl/dds/writer.hpp"
#include "idl/interface/topics.hpp"
#include "nav_msgs.h"
#include "sensor_msgs.h"
#include "server/threads/worker.hpp"
#include "tf2_msgs.h"

namespace stillmap::server {

/// A pose of the robot, or of its lidar where no base is configured.
struct RobotPose {
  std::int64_t stamp_ns = 0;
  Eigen::Isometry3d T_map_base = Eigen::Isometry3d::Identity();
  /// Of (translation, rotation) in the map frame.
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  std::string base_frame;
  /// Where there is a frame odom. Nothing of one that is not its own: nobody knows where that is.
  std::optional<OdomPose> odom;
  /// Whether base in odom is to be published; else somebody else does.
  bool is_odom_own = true;
};

/// Publishes each pose as odometry and as transforms: map -> base, or map -> odom -> base. It
/// writes from a thread of its own: a socket buffer that a slow network has filled blocks this
/// thread, never the mapper. What waits when it is destroyed is written first.
class PosePublisher {
 public:
  PosePublisher(dds::Participant& participant, const dds::Topics& topics,
                const FramesConfig& frames);

  /// Returns at once. When a thousand poses wait, the oldest is dropped, as in the topic's history.
  void publish(const RobotPose& pose);

  /// Publishes a transform on /tf_static, in place of the one before.
  void publish_static(std::int64_t stamp_ns, const FrameTransform& transform);

 private:
  struct Message {
    nav_msgs::msg::Odometry odometry;
    std::optional<nav_msgs::msg::Odometry> local_odometry;
    tf2_msgs::msg::TFMessage tf;
  };

  void write(const Message& message);

  std::string map_frame_;
  std::string odom_frame_;
  dds::Writer<nav_msgs::msg::Odometry> odometry_;
  dds::Writer<tf2_msgs::msg::TFMessage> tf_;
  /// Only with a frame odom of our own, and only with a base.
  std::optional<dds::Writer<nav_msgs::msg::Odometry>> local_odometry_;
  std::optional<dds::Writer<tf2_msgs::msg::TFMessage>> tf_static_;
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
