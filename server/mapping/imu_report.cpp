#include "server/mapping/imu_report.hpp"

#include <spdlog/spdlog.h>

#include <cmath>
#include <cstdint>
#include <string>

#include "core/lidar/angle_units.hpp"

namespace stillmap::server {
namespace {

/// A gyro that is the lidar's is believed after a few degrees of turning.
constexpr double max_unbelieved_turn_rad = 30.0 / deg_per_rad;
/// So many sweeps without samples in a row from the first on are no late start.
constexpr std::uint64_t max_sweeps_without_samples = 30;
/// Samples that are so far from a sweep have another clock.
constexpr double min_clock_difference_s = 1.0;

std::string why_samples_are_missing(double behind_s) {
  if (std::abs(behind_s) < min_clock_difference_s)
    return "they come too late, have gaps of more than 50 ms, or say the same again and again";
  return fmt::format("the newest IMU stamp is {:.1f} s {} the scan's: another clock",
                     std::abs(behind_s), behind_s > 0.0 ? "before" : "after");
}

}  // namespace

void ImuReport::update(const InertialTracker& imu) {
  if (!imu.has_samples()) return;
  const InertialCounts now = imu.counts();
  report_counts(now);
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
  warn_of_no_help(imu);
  was_believed_ = imu.is_believed();
  reported_ = now;
}

void ImuReport::report_counts(const InertialCounts& now) {
  const auto report = [&](const char* event, std::uint64_t InertialCounts::*count) {
    if (now.*count > reported_.*count) statistics_.count(event, now.*count - reported_.*count);
  };
  report("imu_samples", &InertialCounts::samples);
  report("imu_not_usable", &InertialCounts::not_usable);
  report("imu_out_of_order", &InertialCounts::out_of_order);
  report("imu_scans_helped", &InertialCounts::scans_helped);
  report("imu_samples_missing", &InertialCounts::scans_without_samples);
  report("imu_not_yet_believed", &InertialCounts::scans_not_believed);
  report("imu_disbelieved", &InertialCounts::trust_losses);
}

void ImuReport::warn_of_no_help(const InertialTracker& imu) {
  const InertialCounts now = imu.counts();
  const auto behind_s = imu.samples_behind_s();
  const bool covers_none = now.scans_helped + now.scans_not_believed == 0 &&
                           now.scans_without_samples >= max_sweeps_without_samples;
  if (covers_none && behind_s && !has_warned_of_samples_) {
    has_warned_of_samples_ = true;
    spdlog::warn("the IMU's samples cover no sweep: {}; scans are mapped without it",
                 why_samples_are_missing(*behind_s));
  }
  if (imu.unbelieved_turn_rad() > max_unbelieved_turn_rad && !has_warned_of_rates_) {
    has_warned_of_rates_ = true;
    spdlog::warn(
        "the lidar has turned by {:.0f} degrees, and the IMU's rates did not say so: scans are "
        "mapped without it; check 'imu' in the sensor's file, and that rates are in rad/s",
        deg_per_rad * imu.unbelieved_turn_rad());
  }
}

void ImuReport::tell(const std::optional<Levelling>& levelling) {
  if (!levelling || told_of_map_ == levelling->map) return;
  told_of_map_ = levelling->map;
  if (levelling->fault.empty()) {
    spdlog::info("IMU: the map is levelled by it; the lidar leans by {:.1f} degrees",
                 deg_per_rad * levelling->tilt_rad);
  } else {
    spdlog::info("IMU: the map is not levelled by it: {}", levelling->fault);
  }
}

}  // namespace stillmap::server
