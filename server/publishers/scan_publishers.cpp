#include "server/publishers/scan_publishers.hpp"

#include <utility>

#include "idl/conversions/pose.hpp"

namespace stillmap::server {

PosePublisher::PosePublisher(dds::Participant& participant, const dds::Topics& topics,
                             const FramesConfig& frames)
    : map_frame_(frames.map),
      max_queue_length_(static_cast<std::size_t>(topics.odometry.writer.depth)),
      odometry_(participant, topics.odometry.dds_name, topics.odometry.writer),
      tf_(participant, topics.tf.dds_name, topics.tf.writer),
      thread_([this](const std::stop_token& stop) { work(stop); }) {}

PosePublisher::~PosePublisher() = default;

void PosePublisher::publish(std::int64_t stamp_ns, const OdometryResult& odometry,
                            const std::string& lidar_frame) {
  const StampedPose pose{.stamp_ns = stamp_ns, .T_map_lidar = odometry.T_map_lidar};
  Message message{wire::to_odometry(pose, odometry.covariance, map_frame_, lidar_frame),
                  wire::to_tf(pose, map_frame_, lidar_frame)};
  const std::scoped_lock lock(mutex_);
  if (waiting_.size() >= max_queue_length_) waiting_.pop_front();
  waiting_.push_back(std::move(message));
  changed_.notify_one();
}

void PosePublisher::work(const std::stop_token& stop) {
  while (true) {
    std::deque<Message> messages;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, stop, [this] { return !waiting_.empty(); });
      messages.swap(waiting_);
    }
    if (messages.empty()) return;
    for (const Message& message : messages) {
      // Keep-last writers always have room.
      static_cast<void>(odometry_.write(message.odometry));
      static_cast<void>(tf_.write(message.tf));
    }
  }
}

}  // namespace stillmap::server
