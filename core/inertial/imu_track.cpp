#include "core/inertial/imu_track.hpp"

#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

/// 20 s at 400 Hz: longer than any scan waits.
constexpr std::size_t max_samples = 8000;
/// So many samples in a row before the newest one are those of a clock that was set.
constexpr int samples_after_clock_was_set = 100;
/// Noise makes no sample like the one before: so many alike are those of a broken sensor.
constexpr int max_repetitions = 10;
/// Beyond what is sold: 4000 degrees a second, 32 g.
constexpr double max_rate_rad_s = 70.0;
constexpr double max_acceleration_m_s2 = 320.0;

/// A lidar rests when rates and accelerations vary by no more than a sensor's noise (standard
/// deviation [rad/s], and as a share of their mean): whatever drives vibrates more, and its
/// acceleration would be taken for a tilt.
constexpr double max_steady_rate_deviation = 0.01;
constexpr double max_steady_acceleration_share = 0.01;
/// And turns slower than this [rad/s].
constexpr double max_steady_rate = 0.1;
constexpr std::ptrdiff_t min_steady_samples = 5;

double seconds(std::int64_t ns) { return static_cast<double>(ns) * 1e-9; }

bool is_usable(const ImuSample& sample) {
  // Written so that NaN fails.
  return sample.angular_velocity_imu.norm() <= max_rate_rad_s &&
         sample.acceleration_imu.norm() <= max_acceleration_m_s2;
}

bool says_the_same(const ImuSample& a, const ImuSample& b) {
  return a.angular_velocity_imu == b.angular_velocity_imu &&
         a.acceleration_imu == b.acceleration_imu;
}

Eigen::Vector3d interpolated_rate(const ImuSample& a, const ImuSample& b, std::int64_t time_ns) {
  const double share =
      static_cast<double>(time_ns - a.stamp_ns) / static_cast<double>(b.stamp_ns - a.stamp_ns);
  return a.angular_velocity_imu + share * (b.angular_velocity_imu - a.angular_velocity_imu);
}

}  // namespace

Eigen::Vector3d rotation_vector(const Eigen::Quaterniond& q) {
  const Eigen::AngleAxisd angle_axis(q);
  return angle_axis.angle() * angle_axis.axis();
}

Eigen::Quaterniond rotation_by(const Eigen::Vector3d& rotation_vector) {
  const double angle = rotation_vector.norm();
  if (angle < 1e-12) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, rotation_vector / angle));
}

ImuSampleFate ImuTrack::add(const ImuSample& sample) {
  if (!is_usable(sample)) return ImuSampleFate::not_usable;
  if (!entries_.empty() && sample.stamp_ns <= entries_.back().sample.stamp_ns) {
    if (++out_of_order_ < samples_after_clock_was_set) return ImuSampleFate::out_of_order;
    entries_.clear();
  }
  out_of_order_ = 0;
  const bool repeats = !entries_.empty() && says_the_same(entries_.back().sample, sample);
  entries_.push_back({sample, repeats ? entries_.back().repetitions + 1 : 0});
  if (entries_.size() > max_samples) entries_.pop_front();
  return ImuSampleFate::taken;
}

ImuTrack::Entries::const_iterator ImuTrack::before(std::int64_t time_ns) const {
  const auto stamp = [](const Entry& entry) { return entry.sample.stamp_ns; };
  const auto after = std::ranges::upper_bound(entries_, time_ns, {}, stamp);
  if (after == entries_.begin() || entries_.empty()) return entries_.end();
  const auto found = std::prev(after);
  if (after == entries_.end()) return stamp(*found) == time_ns ? found : entries_.end();
  return stamp(*after) - stamp(*found) <= max_gap_ns ? found : entries_.end();
}

std::optional<Eigen::Vector3d> ImuTrack::rate_at(std::int64_t time_ns) const {
  const auto entry = before(time_ns);
  if (entry == entries_.end()) return std::nullopt;
  const auto next = std::next(entry);
  if (next == entries_.end()) return entry->sample.angular_velocity_imu;
  return interpolated_rate(entry->sample, next->sample, time_ns);
}

std::optional<Eigen::Quaterniond> ImuTrack::rotation(std::int64_t from_ns, std::int64_t to_ns,
                                                     const Eigen::Vector3d& bias_imu) const {
  if (from_ns > to_ns) {
    const auto forward = rotation(to_ns, from_ns, bias_imu);
    return forward ? std::optional(forward->conjugate()) : std::nullopt;
  }
  auto entry = before(from_ns);
  if (entry == entries_.end()) return std::nullopt;
  Eigen::Quaterniond R_from_t = Eigen::Quaterniond::Identity();
  std::int64_t time_ns = from_ns;
  while (time_ns < to_ns) {
    const auto next = std::next(entry);
    if (next == entries_.end()) return std::nullopt;
    if (next->sample.stamp_ns - entry->sample.stamp_ns > max_gap_ns) return std::nullopt;
    if (next->repetitions >= max_repetitions) return std::nullopt;
    const std::int64_t end_ns = std::min(next->sample.stamp_ns, to_ns);
    const Eigen::Vector3d rate = 0.5 * (interpolated_rate(entry->sample, next->sample, time_ns) +
                                        interpolated_rate(entry->sample, next->sample, end_ns));
    R_from_t = R_from_t * rotation_by(seconds(end_ns - time_ns) * (rate - bias_imu));
    time_ns = end_ns;
    entry = next;
  }
  return R_from_t.normalized();
}

std::optional<SteadyMean> ImuTrack::steady_mean(std::int64_t from_ns, std::int64_t to_ns) const {
  const auto stamp = [](const Entry& entry) { return entry.sample.stamp_ns; };
  const auto first = std::ranges::lower_bound(entries_, from_ns, {}, stamp);
  const auto last = std::ranges::upper_bound(entries_, to_ns, {}, stamp);
  const std::ptrdiff_t count = last - first;
  if (count < min_steady_samples) return std::nullopt;
  const auto is_frozen = [count](const Entry& entry) {
    return entry.repetitions >= std::min<std::ptrdiff_t>(max_repetitions, count - 1);
  };
  Eigen::Vector3d rate = Eigen::Vector3d::Zero();
  Eigen::Vector3d acceleration = Eigen::Vector3d::Zero();
  for (auto entry = first; entry != last; ++entry) {
    rate += entry->sample.angular_velocity_imu / static_cast<double>(count);
    acceleration += entry->sample.acceleration_imu / static_cast<double>(count);
  }
  double rate_variance = 0.0;
  double acceleration_variance = 0.0;
  for (auto entry = first; entry != last; ++entry) {
    const auto n = static_cast<double>(count);
    rate_variance += (entry->sample.angular_velocity_imu - rate).squaredNorm() / n;
    acceleration_variance += (entry->sample.acceleration_imu - acceleration).squaredNorm() / n;
  }
  const bool is_steady =
      rate.norm() < max_steady_rate && std::sqrt(rate_variance) < max_steady_rate_deviation &&
      std::sqrt(acceleration_variance) < max_steady_acceleration_share * acceleration.norm();
  if (!is_steady) return std::nullopt;
  return SteadyMean{.angular_velocity_imu = rate,
                    .up_imu = acceleration.normalized(),
                    .acceleration_m_s2 = acceleration.norm(),
                    .duration_s = seconds(stamp(*std::prev(last)) - stamp(*first)),
                    .is_frozen = std::any_of(first, last, is_frozen)};
}

}  // namespace stillmap
