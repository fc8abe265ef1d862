#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <string>

#include "core/frames/frame_tree.hpp"
#include "idl/dds/reader.hpp"
#include "idl/interface/topics.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"
#include "server/monitoring/unreadable_samples.hpp"
#include "server/threads/periodic_worker.hpp"

namespace stillmap::server {

/// What the robot publishes on /tf_static. Thread-safe.
class StaticTransforms {
 public:
  StaticTransforms(dds::Participant& participant, const dds::Topics& topics,
                   Statistics& statistics);

  /// T_target_source; nothing while the two do not hang together.
  [[nodiscard]] std::optional<Eigen::Isometry3d> find(const std::string& target,
                                                      const std::string& source) const;
  /// The same, waiting for it up to `timeout`.
  [[nodiscard]] std::optional<Eigen::Isometry3d> wait_for(
      const std::string& target, const std::string& source,
      std::chrono::duration<double> timeout) const;

  /// The frames that were published so far, for messages.
  [[nodiscard]] std::string known_frames() const;

 private:
  void take(const tf2_msgs::msg::TFMessage& message);

  Statistics& statistics_;
  ThrottledLog throttled_log_;
  mutable std::mutex mutex_;
  mutable std::condition_variable changed_;
  FrameTree tree_;
  UnreadableSamples unreadable_;
  dds::Reader<tf2_msgs::msg::TFMessage> reader_;
  // Last: stops before what it uses is gone.
  PeriodicWorker worker_;
};

}  // namespace stillmap::server
