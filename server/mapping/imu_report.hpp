#pragma once

#include <cstdint>
#include <optional>

#include "core/mapper.hpp"
#include "server/monitoring/log.hpp"
#include "server/monitoring/statistics.hpp"

namespace stillmap::server {

/// What becomes of the IMU's samples, as counters of the status and in the log.
class ImuReport {
 public:
  explicit ImuReport(Statistics& statistics) : statistics_(statistics) {}

  /// Reports what is new since the last call. To be called after each scan.
  void update(const InertialTracker& imu);
  /// Tells once a map how the IMU levelled its start, or why it did not.
  void tell(const std::optional<Levelling>& levelling);

 private:
  void report_counts(const InertialCounts& now);
  /// Warns once of an IMU whose samples never cover a sweep, or never foretell a turn.
  void warn_of_no_help(const InertialTracker& imu);

  Statistics& statistics_;
  ThrottledLog throttled_log_;
  InertialCounts reported_;
  bool was_believed_ = false;
  bool has_warned_of_samples_ = false;
  bool has_warned_of_rates_ = false;
  /// The last map whose levelling was told.
  std::optional<std::uint32_t> told_of_map_;
};

}  // namespace stillmap::server
