#include "core/inertial/imu_track.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace stillmap {
namespace {

/// 20 s at 400 Hz: longer than any scan waits.
constexpr std::size_t max_samples = 8000;
/// So many samples in a row before the newest one are those of a clock that was set.
constexpr int samples_after_clock_was_set = 100;
/// Noise makes no sample like the one before: so many alike are those of a broken sensor.
constexpr int max_repetitions = 10;
/// Rates that grow and shrink by turns so often, each time within so many samples, and by more than
/// this, are those of a gyro with noise. Those of a turn of a simulated robot only grow, or shrink.
constexpr int min_reversals = 8;
constexpr int max_samples_to_reversal = 4;
constexpr double min_noise_rad_s = 1e-5;
/// A rate of such a gyro above this [rad/s] that is the same in more samples than this is the end
/// of its range: the least that are sold go to 2 rad/s.
constexpr double min_saturated_rate = 1.0;
constexpr int max_fast_repetitions = 4;
/// Up to three samples are a glitch where they differ from the median of the six others next to
/// them by more than any robot's turn changes, and than those differ among themselves: by this many
/// times their median difference. The median is that of two samples away at the peak of a jolt.
constexpr std::ptrdiff_t samples_round_glitch = 6;
constexpr double samples_to_median = 2.0;
constexpr double min_glitch_rad_s = 1.0;
constexpr double max_angular_acceleration = 200.0;
constexpr double min_glitch_deviations = 8.0;
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

/// Of an even number of values: the mean of the two in the middle.
double median_of(std::array<double, samples_round_glitch> values) {
  std::ranges::sort(values);
  return 0.5 * (values[values.size() / 2 - 1] + values[values.size() / 2]);
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

bool ImuTrack::tells_rate(const Entry& entry) {
  if (entry.repetitions >= max_repetitions) return false;
  // A simulated one without noise may say the same for long, and be right.
  if ((entry.noisy_reversals < min_reversals).all()) return true;
  const Eigen::Array3d rate = entry.sample.angular_velocity_imu.array();
  // Some gyros say zero as long as they rest.
  const bool is_stuck = (entry.rate_repetitions >= max_repetitions).all() && (rate != 0.0).any();
  const bool is_saturated =
      (rate.abs() > min_saturated_rate && entry.rate_repetitions >= max_fast_repetitions).any();
  return !is_stuck && !is_saturated;
}

Eigen::Vector3d ImuTrack::interpolated_rate(const Entry& a, const Entry& b, std::int64_t time_ns) {
  const double share = static_cast<double>(time_ns - a.sample.stamp_ns) /
                       static_cast<double>(b.sample.stamp_ns - a.sample.stamp_ns);
  return a.rate_imu + share * (b.rate_imu - a.rate_imu);
}

Eigen::Vector3d ImuTrack::rate_without_glitch(std::ptrdiff_t index) const {
  const auto at = [&](std::ptrdiff_t k) -> const ImuSample& {
    return (entries_.begin() + k)->sample;
  };
  const auto count = static_cast<std::ptrdiff_t>(entries_.size());
  Eigen::Vector3d rate = at(index).angular_velocity_imu;
  if (count <= samples_round_glitch) return rate;
  const std::ptrdiff_t first = std::clamp<std::ptrdiff_t>(index - samples_round_glitch / 2, 0,
                                                          count - 1 - samples_round_glitch);
  const double step_s = seconds(at(first + samples_round_glitch).stamp_ns - at(first).stamp_ns) /
                        static_cast<double>(samples_round_glitch);
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    std::array<double, samples_round_glitch> others{};
    for (std::ptrdiff_t k = 0; k < samples_round_glitch; ++k)
      others[static_cast<std::size_t>(k)] =
          at(first + k + (first + k >= index ? 1 : 0)).angular_velocity_imu(axis);
    const double median = median_of(others);
    for (double& other : others) other = std::abs(other - median);
    const double bearable =
        std::max({min_glitch_rad_s, max_angular_acceleration * samples_to_median * step_s,
                  min_glitch_deviations * median_of(others)});
    if (std::abs(rate(axis) - median) > bearable) rate(axis) = median;
  }
  return rate;
}

void ImuTrack::compare(const Entry& last, Entry& entry) {
  // Counts end where they tell enough: an IMU may run for months.
  if (says_the_same(last.sample, entry.sample))
    entry.repetitions = std::min(last.repetitions + 1, max_repetitions);
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const double step =
        entry.sample.angular_velocity_imu(axis) - last.sample.angular_velocity_imu(axis);
    entry.rate_direction(axis) = last.rate_direction(axis);
    entry.noisy_reversals(axis) = last.noisy_reversals(axis);
    entry.since_reversal(axis) =
        std::min(last.since_reversal(axis) + 1, max_samples_to_reversal + 1);
    if (step == 0.0) {
      entry.rate_repetitions(axis) = std::min(last.rate_repetitions(axis) + 1, max_repetitions);
      continue;
    }
    // Of a coarse scale two in a row may be the same.
    if (last.rate_repetitions(axis) > 1) entry.noisy_reversals(axis) = 0;
    if (std::abs(step) < min_noise_rad_s) continue;
    const int direction = step > 0.0 ? 1 : -1;
    if (direction == last.rate_direction(axis)) continue;
    if (entry.since_reversal(axis) <= max_samples_to_reversal)
      entry.noisy_reversals(axis) = std::min(entry.noisy_reversals(axis) + 1, min_reversals);
    entry.rate_direction(axis) = direction;
    entry.since_reversal(axis) = 0;
  }
}

ImuSampleFate ImuTrack::add(const ImuSample& sample) {
  if (!is_usable(sample)) return ImuSampleFate::not_usable;
  if (!entries_.empty() && sample.stamp_ns <= entries_.back().sample.stamp_ns) {
    if (++out_of_order_ < samples_after_clock_was_set) return ImuSampleFate::out_of_order;
    entries_.clear();
  }
  out_of_order_ = 0;
  Entry entry{.sample = sample, .rate_imu = sample.angular_velocity_imu};
  if (!entries_.empty()) compare(entries_.back(), entry);
  entries_.push_back(entry);
  if (entries_.size() > max_samples) entries_.pop_front();
  // The newest ones are judged again by those that come after them.
  const auto count = static_cast<std::ptrdiff_t>(entries_.size());
  for (auto k = std::max<std::ptrdiff_t>(0, count - 1 - samples_round_glitch / 2); k < count; ++k)
    (entries_.begin() + k)->rate_imu = rate_without_glitch(k);
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
  if (next == entries_.end()) return entry->rate_imu;
  return interpolated_rate(*entry, *next, time_ns);
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
    if (!tells_rate(*next)) return std::nullopt;
    const std::int64_t end_ns = std::min(next->sample.stamp_ns, to_ns);
    const Eigen::Vector3d rate = 0.5 * (interpolated_rate(*entry, *next, time_ns) +
                                        interpolated_rate(*entry, *next, end_ns));
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
    rate += entry->rate_imu / static_cast<double>(count);
    acceleration += entry->sample.acceleration_imu / static_cast<double>(count);
  }
  double rate_variance = 0.0;
  double acceleration_variance = 0.0;
  for (auto entry = first; entry != last; ++entry) {
    const auto n = static_cast<double>(count);
    rate_variance += (entry->rate_imu - rate).squaredNorm() / n;
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
