#include "server/mapping/imu_report.hpp"

#include <spdlog/spdlog.h>

#include <cstdint>

namespace stillmap::server {

void ImuReport::update(const InertialTracker& imu) {
  if (!imu.has_samples()) return;
  const InertialCounts now = imu.counts();
  const auto report = [&](const char* event, std::uint64_t InertialCounts::*count) {
    if (now.*count > reported_.*count) statistics_.count(event, now.*count - reported_.*count);
  };
  report("imu_samples", &InertialCounts::samples);
  report("imu_not_usable", &InertialCounts::not_usable);
  report("imu_out_of_order", &InertialCounts::out_of_order);
  report("imu_scans_helped", &InertialCounts::scans_helped);
  report("imu_samples_missing", &InertialCounts::scans_without_samples);
  report("imu_disbelieved", &InertialCounts::trust_losses);
  if (now.trust_losses > reported_.trust_losses) {
    throttled_log_.warn("imu",
                        "the IMU's rates are not the lidar's: scans are mapped without it until "
                        "they are; check 'imu' in the sensor's file, and that rates are in rad/s");
  }
  if (imu.is_believed() && !was_believed_) {
    const GyroCalibration& calibration = imu.calibration();
    spdlog::info(
        "IMU: its rates are the lidar's, with a bias of {:.4f} {:.4f} {:.4f} rad/s and "
        "{:.1f} ms late",
        calibration.bias_imu().x(), calibration.bias_imu().y(), calibration.bias_imu().z(),
        1e3 * calibration.time_offset_s());
  }
  was_believed_ = imu.is_believed();
  reported_ = now;
}

}  // namespace stillmap::server
