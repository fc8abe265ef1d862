#include "server/publishers/scan_publishers.hpp"

#include <utility>

#include "core/frames/rigid_motion.hpp"
#include "idl/conversions/pose.hpp"
#include "idl/conversions/to_cloud.hpp"

namespace stillmap::server {

PosePublisher::PosePublisher(dds::Participant& participant, const dds::Topics& topics,
                             const FramesConfig& frames)
    : map_frame_(frames.map),
      odom_frame_(frames.odom),
      odometry_(participant, topics.odometry.dds_name, topics.odometry.writer),
      tf_(participant, topics.tf.dds_name, topics.tf.writer),
      queue_(static_cast<std::size_t>(topics.odometry.writer.depth)),
      worker_("poses", queue_, [this](const Message& message) { write(message); },
              {.finishes_queue = true}) {
  if (!frames.odom.empty() && frames.odom_source == FramesConfig::OdomSource::own) {
    local_odometry_.emplace(participant, topics.local_odometry.dds_name,
                            topics.local_odometry.writer);
  }
  if (!frames.base.empty()) {
    tf_static_.emplace(participant, topics.tf_static.dds_name, topics.tf_static.writer);
  }
}

void PosePublisher::publish(const RobotPose& pose) {
  const std::string& base = pose.base_frame;
  Message message{.odometry = wire::to_odometry({pose.stamp_ns, pose.T_map_base}, pose.covariance,
                                                map_frame_, base),
                  .local_odometry = std::nullopt,
                  .tf = {}};
  std::vector<FrameTransform> transforms;
  if (pose.odom) {
    const auto& [T_map_odom, T_odom_base, velocity] = *pose.odom;
    transforms.push_back({map_frame_, odom_frame_, T_map_odom});
    if (pose.is_odom_own) {
      transforms.push_back({odom_frame_, base, T_odom_base});
      message.local_odometry =
          wire::to_odometry({pose.stamp_ns, T_odom_base},
                            turned_covariance(pose.covariance, T_map_odom.linear().transpose()),
                            odom_frame_, base, velocity);
    }
  } else if (pose.is_odom_own) {
    transforms.push_back({map_frame_, base, pose.T_map_base});
  }
  message.tf = wire::to_tf(pose.stamp_ns, transforms);
  queue_.push_dropping_oldest(std::move(message));
}

void PosePublisher::publish_static(std::int64_t stamp_ns, const FrameTransform& transform) {
  if (tf_static_) static_cast<void>(tf_static_->write(wire::to_tf(stamp_ns, {transform})));
}

void PosePublisher::write(const Message& message) {
  // Keep-last writers always have room.
  static_cast<void>(odometry_.write(message.odometry));
  if (message.local_odometry) static_cast<void>(local_odometry_->write(*message.local_odometry));
  if (!message.tf.transforms().empty()) static_cast<void>(tf_.write(message.tf));
}

LabelledScanPublisher::LabelledScanPublisher(dds::Participant& participant,
                                             const dds::Topics& topics)
    : writer_(participant, topics.scan.dds_name, topics.scan.writer),
      worker_("labelled_scans", newest_, [this](const Message& message) { write(message); },
              {.finishes_queue = true}) {}

void LabelledScanPublisher::publish(std::shared_ptr<const LabelledScan> labelled,
                                    const std::string& lidar_frame) {
  // A message of megabytes that nobody reads is not worth converting.
  if (writer_.readers().count() == 0) return;
  newest_.push_dropping_oldest({std::move(labelled), lidar_frame});
}

void LabelledScanPublisher::write(const Message& message) {
  // Best effort, newest only: there is always room.
  static_cast<void>(writer_.write(wire::to_cloud(*message.labelled, message.lidar_frame)));
}

}  // namespace stillmap::server
