#include "core/geodesy/gnss_track.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

namespace stillmap {
namespace {

/// Fixes come late by up to a second or two.
constexpr std::size_t max_scans = 100;
/// 50 s at 20 Hz.
constexpr std::size_t max_waiting = 1000;
/// Between scans that are farther apart than both nobody knows where the antenna was.
constexpr std::int64_t max_gap_ns = 1'500'000'000;
constexpr double max_gap_m = 0.5;
/// Of a height that is not known: one that is said to be worse is taken for that [m].
constexpr double unknown_sigma_m = 1e4;
/// No robot goes so far between two fixes: they are of different places [m].
constexpr double max_jump_m = 50e3;
/// Fixes of one place follow each other within this [m].
constexpr double max_step_m = 5e3;
/// So few fixes of another place are a fault of the receiver.
constexpr std::size_t min_strays = 5;

double horizontal_sigma_m(const GnssFix& fix) {
  return std::sqrt(0.5 * fix.covariance_enu.topLeftCorner<2, 2>().trace());
}

EastNorthUp frame_about(const GnssFix& fix) {
  return {fix.latitude_deg, fix.longitude_deg, std::isnan(fix.altitude_m) ? 0.0 : fix.altitude_m};
}

double distance_m(const GnssFix& from, const GnssFix& to) {
  return frame_about(from).position_enu(to).norm();
}

}  // namespace

std::string GnssTrack::add(const GnssFix& fix) {
  if (std::string fault = fault_of(fix); !fault.empty()) return fault;
  const double sigma_m = horizontal_sigma_m(fix);
  if (sigma_m > config_.max_sigma_m) {
    return "its standard deviation is " + std::to_string(sigma_m) + " m, above the " +
           std::to_string(config_.max_sigma_m) + " m that are used";
  }
  if (waiting_.size() >= max_waiting) {
    waiting_.pop_front();
    ++misplaced_;
  }
  judge_origin(fix);
  waiting_.push_back(fix);
  waiting_.back().covariance_enu.diagonal().array() += config_.min_sigma_m * config_.min_sigma_m;
  const bool has_height =
      !std::isnan(fix.altitude_m) && fix.covariance_enu(2, 2) < unknown_sigma_m * unknown_sigma_m;
  if (!has_height) {
    waiting_.back().covariance_enu.row(2).setZero();
    waiting_.back().covariance_enu.col(2).setZero();
    waiting_.back().covariance_enu(2, 2) = unknown_sigma_m * unknown_sigma_m;
  }
  return "";
}

void GnssTrack::judge_origin(const GnssFix& fix) {
  if (!enu_) begin_at(fix);
  if (distance_m(last_believed_, fix) <= max_jump_m) {
    last_believed_ = fix;
    ++believed_;
    strays_ = 0;
    return;
  }
  if (strays_ > 0 && distance_m(last_stray_, fix) > max_step_m) strays_ = 0;
  if (strays_++ == 0) first_stray_ = fix;
  last_stray_ = fix;
  if (strays_ < min_strays || strays_ <= believed_) return;
  begin_at(first_stray_);
  believed_ = std::exchange(strays_, 0);
  last_believed_ = fix;
}

void GnssTrack::begin_at(const GnssFix& fix) {
  enu_ = frame_about(fix);
  last_believed_ = fix;
  ++origins_;
  misplaced_ += std::erase_if(
      waiting_, [&](const GnssFix& other) { return distance_m(fix, other) > max_jump_m; });
}

void GnssTrack::add_scan(std::size_t scan, std::int64_t stamp_ns,
                         const Eigen::Isometry3d& T_odom_lidar,
                         const Eigen::Vector3d& antenna_lidar) {
  if (!scans_.empty() && stamp_ns <= scans_.back().stamp_ns) {
    scans_.clear();
    misplaced_ += waiting_.size();
    waiting_.clear();
  }
  scans_.push_back({scan, stamp_ns, T_odom_lidar, T_odom_lidar * antenna_lidar});
  if (scans_.size() > max_scans) scans_.pop_front();
}

std::vector<PositionAtScan> GnssTrack::take() {
  std::vector<PositionAtScan> placed;
  if (scans_.empty()) return placed;
  std::deque<GnssFix> still_waiting;
  for (const GnssFix& fix : waiting_) {
    if (fix.stamp_ns > scans_.back().stamp_ns) {
      still_waiting.push_back(fix);
    } else if (auto position = between_scans(fix)) {
      placed.push_back(*std::move(position));
    } else {
      ++misplaced_;
    }
  }
  waiting_ = std::move(still_waiting);
  placed_ += placed.size();
  return placed;
}

std::optional<PositionAtScan> GnssTrack::between_scans(const GnssFix& fix) const {
  const auto after = std::ranges::lower_bound(scans_, fix.stamp_ns, {}, &ScanPose::stamp_ns);
  if (after == scans_.end()) return std::nullopt;
  Eigen::Vector3d antenna_odom = after->antenna_odom;
  if (after->stamp_ns != fix.stamp_ns) {
    if (after == scans_.begin()) return std::nullopt;
    const ScanPose& before = *std::prev(after);
    const std::int64_t gap_ns = after->stamp_ns - before.stamp_ns;
    const Eigen::Vector3d way_odom = after->antenna_odom - before.antenna_odom;
    if (gap_ns > max_gap_ns && way_odom.norm() > max_gap_m) return std::nullopt;
    antenna_odom = before.antenna_odom + static_cast<double>(fix.stamp_ns - before.stamp_ns) /
                                             static_cast<double>(gap_ns) * way_odom;
  }
  return PositionAtScan{after->scan, after->T_odom_lidar.inverse() * antenna_odom,
                        enu_->position_enu(fix), fix.covariance_enu};
}

}  // namespace stillmap
