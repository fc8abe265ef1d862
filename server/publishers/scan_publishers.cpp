#include "server/publishers/scan_publishers.hpp"

#include <utility>

#include "idl/conversions/pose.hpp"
#include "idl/conversions/to_cloud.hpp"

namespace stillmap::server {

PosePublisher::PosePublisher(dds::Participant& participant, const dds::Topics& topics,
                             const FramesConfig& frames)
    : map_frame_(frames.map),
      odometry_(participant, topics.odometry.dds_name, topics.odometry.writer),
      tf_(participant, topics.tf.dds_name, topics.tf.writer),
      queue_(static_cast<std::size_t>(topics.odometry.writer.depth)),
      worker_(queue_, [this](const Message& message) { write(message); },
              {.finishes_queue = true}) {}

void PosePublisher::publish(std::int64_t stamp_ns, const OdometryResult& odometry,
                            const std::string& lidar_frame) {
  const StampedPose pose{.stamp_ns = stamp_ns, .T_map_lidar = odometry.T_map_lidar};
  queue_.push_dropping_oldest(
      {wire::to_odometry(pose, odometry.covariance, map_frame_, lidar_frame),
       wire::to_tf(pose, map_frame_, lidar_frame)});
}

void PosePublisher::write(const Message& message) {
  // Keep-last writers always have room.
  static_cast<void>(odometry_.write(message.odometry));
  static_cast<void>(tf_.write(message.tf));
}

LabelledScanPublisher::LabelledScanPublisher(dds::Participant& participant,
                                             const dds::Topics& topics)
    : writer_(participant, topics.scan.dds_name, topics.scan.writer),
      worker_(newest_, [this](const Message& message) { write(message); },
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
