#pragma once

#include "core/inertial/inertial_tracker.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"

namespace stillmap::server {

/// What becomes of the IMU's samples, as counters of the status and in the log.
class ImuReport {
 public:
  explicit ImuReport(Statistics& statistics) : statistics_(statistics) {}

  /// Reports what is new since the last call. To be called after each scan.
  void update(const InertialTracker& imu);

 private:
  Statistics& statistics_;
  ThrottledLog throttled_log_;
  InertialCounts reported_;
  bool was_believed_ = false;
};

}  // namespace stillmap::server
