#include "core/geodesy/gnss_track.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

namespace stillmap {
namespace {

/// More than an hour at 10 Hz of a robot that moves.
constexpr std::size_t max_scans = 50'000;
constexpr std::size_t max_known = 50'000;
/// Of stamps ahead of the scans, 50 s at 100 Hz.
constexpr std::size_t max_waiting = 5000;
/// Of a height that is not known: one that is said to be worse is taken for that [m].
constexpr double unknown_sigma_m = 1e4;
/// No robot goes so far between two fixes: they are of different places [m].
constexpr double max_jump_m = 50e3;
/// Fixes of one place follow each other within this [m].
constexpr double max_step_m = 5e3;
/// So few fixes of another place are a fault of the receiver.
constexpr std::size_t min_strays = 5;
/// Fixes that tell something of the way for another delay.
constexpr double min_moved_m = 0.3;
constexpr std::int64_t min_apart_ns = 1'000'000'000;
/// The delay is judged after so much more way, and so much as a share of all.
constexpr double judged_way_m = 50.0;
constexpr double judged_share_of_way = 0.25;
/// A robot that was never farther than this from where it began stands there still [m].
constexpr double max_standing_m = 1.0;

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
  remember(waiting_.back());
  return "";
}

void GnssTrack::remember(const GnssFix& fix) {
  if (config_.delay_s) return;
  if (!known_.empty() && std::abs(fix.stamp_ns - known_.back().stamp_ns) < min_apart_ns &&
      distance_m(known_.back(), fix) < min_moved_m)
    return;
  known_.push_back(fix);
  if (known_.size() <= max_known) return;
  forget_way(known_.front().stamp_ns);
  known_.pop_front();
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
  const auto is_elsewhere = [&](const GnssFix& other) {
    return distance_m(fix, other) > max_jump_m;
  };
  misplaced_ += std::erase_if(waiting_, is_elsewhere);
  std::erase_if(known_, is_elsewhere);
}

void GnssTrack::add_scan(std::size_t scan, std::int64_t stamp_ns,
                         const Eigen::Isometry3d& T_odom_lidar,
                         const Eigen::Vector3d& antenna_lidar) {
  if (!scans_.empty() && stamp_ns <= scans_.back().stamp_ns) {
    scans_.clear();
    misplaced_ += waiting_.size();
    waiting_.clear();
    known_.clear();
    has_forgotten_way_ |= left_ns_.has_value();
  }
  const Eigen::Vector3d at_odom = T_odom_lidar.translation();
  if (!begin_odom_) begin_odom_ = at_odom;
  if (!left_ns_ && (at_odom - *begin_odom_).norm() > max_standing_m) left_ns_ = stamp_ns;
  if (!scans_.empty()) {
    way_m_ += (at_odom - scans_.back().T_odom_lidar.translation()).norm();
  }
  scans_.push_back({scan, stamp_ns, T_odom_lidar, antenna_lidar});
  if (scans_.size() <= max_scans) return;
  forget_way(scans_.front().stamp_ns);
  scans_.pop_front();
}

void GnssTrack::forget_way(std::int64_t stamp_ns) {
  has_forgotten_way_ |= left_ns_ && stamp_ns >= *left_ns_;
}

std::vector<PositionAtScan> GnssTrack::take() {
  std::vector<PositionAtScan> placed;
  if (scans_.empty()) return placed;
  std::deque<GnssFix> still_waiting;
  for (const GnssFix& fix : waiting_) {
    if (time_of(fix) > scans_.back().stamp_ns) {
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

bool GnssTrack::judge_delay(bool is_end) {
  if (config_.delay_s || !enu_ || has_forgotten_way_ || (!is_end && way_m_ < next_judged_m_))
    return false;
  next_judged_m_ = way_m_ + std::max(judged_way_m, judged_share_of_way * way_m_);
  const auto found = estimated_delay();
  if (!found) return false;
  const auto other = revised(delay_, *found);
  if (!other) return false;
  delay_ = *other;
  waiting_ = known_;
  placed_ = misplaced_ = 0;
  return true;
}

std::optional<GnssDelay> GnssTrack::estimated_delay() const {
  std::vector<PlanPose> way;
  for (const ScanPose& scan : scans_) {
    way.push_back({scan.stamp_ns, (scan.T_odom_lidar * scan.antenna_lidar).head<2>(),
                   scan.T_odom_lidar.linear().topLeftCorner<2, 2>()});
  }
  std::vector<PlanFix> fixes;
  for (const GnssFix& fix : known_) {
    fixes.push_back({fix.stamp_ns, enu_->position_enu(fix).head<2>(), horizontal_sigma_m(fix)});
  }
  std::ranges::stable_sort(fixes, {}, &PlanFix::stamp_ns);
  return estimate_delay(way, fixes, {.antenna_sigma_m = config_.antenna_sigma_m});
}

std::int64_t GnssTrack::time_of(const GnssFix& fix) const {
  return fix.stamp_ns - std::llround(delay_.delay_s * 1e9);
}

Eigen::Vector3d GnssTrack::antenna_odom(const ScanPose& scan) const {
  Eigen::Vector3d antenna_lidar = scan.antenna_lidar;
  antenna_lidar.head<2>() += delay_.antenna_lidar;
  return scan.T_odom_lidar * antenna_lidar;
}

std::optional<PositionAtScan> GnssTrack::between_scans(const GnssFix& fix) const {
  const std::int64_t time_ns = time_of(fix);
  const auto after = std::ranges::lower_bound(scans_, time_ns, {}, &ScanPose::stamp_ns);
  if (after == scans_.end()) return std::nullopt;
  Eigen::Vector3d place_odom = antenna_odom(*after);
  if (after->stamp_ns != time_ns) {
    if (after == scans_.begin()) return std::nullopt;
    const ScanPose& before = *std::prev(after);
    const std::int64_t gap_ns = after->stamp_ns - before.stamp_ns;
    const Eigen::Vector3d way_odom = place_odom - antenna_odom(before);
    if (is_gap(gap_ns, way_odom.norm())) return std::nullopt;
    place_odom -=
        static_cast<double>(after->stamp_ns - time_ns) / static_cast<double>(gap_ns) * way_odom;
  }
  return PositionAtScan{after->scan, after->T_odom_lidar.inverse() * place_odom,
                        enu_->position_enu(fix), fix.covariance_enu};
}

}  // namespace stillmap
