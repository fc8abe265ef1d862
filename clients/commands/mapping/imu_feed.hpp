#pragma once

#include <cstddef>
#include <span>
#include <utility>
#include <vector>

#include "core/inertial/imu_sample.hpp"
#include "core/lidar/scan.hpp"

namespace stillmap::cli {

/// The samples of a recorded IMU, handed out with the scans.
class ImuFeed {
 public:
  explicit ImuFeed(std::vector<ImuSample> samples) : samples_(std::move(samples)) {}

  [[nodiscard]] bool empty() const { return samples_.empty(); }
  /// Those that were not taken yet, up to just after the scan's last point.
  [[nodiscard]] std::span<const ImuSample> take_up_to_end_of(const Scan& scan, double period_s);

 private:
  std::vector<ImuSample> samples_;
  std::size_t next_ = 0;
};

}  // namespace stillmap::cli
