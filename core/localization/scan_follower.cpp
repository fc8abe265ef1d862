#include "core/localization/scan_follower.hpp"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "core/lidar/prepare.hpp"

namespace stillmap {
namespace {

/// The first scan is taken as it was measured, the second one shows a motion that is off by what
/// bent the first, and the third one is good: in a turn of 50 degrees a second, the pose by the
/// second is up to 1.4 degrees off, that by the third 0.4.
constexpr std::size_t scans_before = 3;
constexpr int min_followed = 3;
/// Scans farther apart in time tell little of one another's motion.
constexpr std::int64_t max_apart_ns = 500'000'000;

}  // namespace

ScanFollower::ScanFollower(const OdometryConfig& odometry, const SensorModel& sensor, Read read)
    : sensor_(sensor), read_(std::move(read)), odometry_(odometry, sensor) {}

void ScanFollower::begin() {
  odometry_.reset();
  followed_ = 0;
}

std::optional<Scan> ScanFollower::follow(Scan scan) {
  if (followed_ > 0 && std::abs(scan.stamp_ns - last_stamp_ns_) > max_apart_ns) begin();
  last_stamp_ns_ = scan.stamp_ns;
  const SweepTimes sweep = sweep_times(scan, sensor_.period_s);
  odometry_.sweep_motion(sweep).move_to_middle(scan, sweep);
  const OdometryResult result =
      odometry_.register_scan(scan, sweep, PointLabels{}, std::nullopt).result;
  const bool is_followed = result.health == OdometryHealth::good && result.is_confirmed();
  if (followed_ > 0 && !is_followed) {
    begin();
    return std::nullopt;
  }
  return ++followed_ >= min_followed ? std::optional(std::move(scan)) : std::nullopt;
}

std::optional<Scan> ScanFollower::at_stamp(std::size_t index, const Scan& scan) {
  if (sweep_times(scan, sensor_.period_s).duration_s <= 0.0) return std::nullopt;
  if (followed_ == 0 || last_index_ + 1 != index) {
    begin();
    for (std::size_t back = std::min(scans_before, index); back > 0; --back) {
      std::optional<Scan> earlier = read_(index - back);
      if (earlier) {
        static_cast<void>(follow(*std::move(earlier)));
      } else {
        begin();
      }
    }
  }
  last_index_ = index;
  return follow(scan);
}

}  // namespace stillmap
