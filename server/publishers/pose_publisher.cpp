#include "server/publishers/pose_publisher.hpp"

#include "idl/conversions/pose.hpp"

namespace stillmap {

PosePublisher::PosePublisher(Participant& participant, const Topics& topics,
                             const FramesConfig& frames)
    : map_frame_(frames.map),
      odometry_(participant, topics.odometry.dds_name, topics.odometry.writer),
      tf_(participant, topics.tf.dds_name, topics.tf.writer) {}

void PosePublisher::publish(std::int64_t stamp_ns, const OdometryResult& odometry,
                            const std::string& lidar_frame) {
  const StampedPose pose{.stamp_ns = stamp_ns, .T_map_lidar = odometry.T_map_lidar};
  // A keep-last writer always has room.
  static_cast<void>(
      odometry_.write(wire::to_odometry(pose, odometry.covariance, map_frame_, lidar_frame)));
  static_cast<void>(tf_.write(wire::to_tf(pose, map_frame_, lidar_frame)));
}

}  // namespace stillmap
