#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "core/inertial/imu_sample.hpp"
#include "idl/dds/reader.hpp"
#include "idl/interface/server_status.hpp"
#include "sensor_msgs.h"
#include "server/monitoring/statistics.hpp"
#include "server/monitoring/unreadable_samples.hpp"
#include "server/threads/periodic_worker.hpp"

namespace stillmap::server {

/// Samples on their way from the IMU to the mapper. Thread-safe.
class ImuQueue {
 public:
  /// When too many wait, the oldest are dropped.
  void push(const ImuSample& sample);

  /// All samples since the last call. Waits up to `patience` for the one at or after `until_ns`, as
  /// a scan often comes before the last samples of its sweep; but not after many waits in vain,
  /// until the sample comes within the patience of a call that did not wait for it.
  [[nodiscard]] std::vector<ImuSample> take(std::int64_t until_ns,
                                            std::chrono::milliseconds patience);

 private:
  [[nodiscard]] bool reaches(std::int64_t until_ns) const { return newest_ns_ >= until_ns; }

  std::mutex mutex_;
  std::condition_variable pushed_;
  std::vector<ImuSample> samples_;
  std::optional<std::int64_t> newest_ns_;
  /// Waits in a row that ended without the sample.
  int vain_waits_ = 0;
  /// The sample that the last call did without, and until when it would have waited for it.
  struct Missed {
    std::int64_t until_ns = 0;
    std::chrono::steady_clock::time_point deadline;
  };
  std::optional<Missed> missed_;
};

/// Receives sensor_msgs/Imu.
class ImuReceiver {
 public:
  ImuReceiver(dds::Participant& participant, const std::string& ros_topic, DeliveryMode delivery,
              Statistics& statistics);

  /// As ImuQueue::take, of samples until so much later, too, and as much more patient. Does not
  /// wait where nobody publishes.
  [[nodiscard]] std::vector<ImuSample> take(std::int64_t until_ns, std::chrono::nanoseconds more);

 private:
  std::chrono::milliseconds patience_;
  ImuQueue queue_;
  UnreadableSamples unreadable_;
  dds::Reader<sensor_msgs::msg::Imu> reader_;
  // Last: stops before what it uses is gone.
  PeriodicWorker worker_;
};

}  // namespace stillmap::server
