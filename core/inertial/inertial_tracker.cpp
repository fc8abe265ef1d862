#include "core/inertial/inertial_tracker.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

namespace stillmap {
namespace {

/// A sweep's rotation is told at times this far apart at most [s].
constexpr double sweep_step_s = 0.0025;
constexpr int max_sweep_steps = 400;
/// Up is the mean over this time.
constexpr std::int64_t up_window_ns = 500'000'000;
/// And over this time at least: in a shorter one, to brake looks like a tilt [s].
constexpr double min_up_s = 0.2;
/// Gravity is measured within this share of it, in m/s^2 or, as Livox's drivers have it, in g.
constexpr double gravity_m_s2 = 9.81;
constexpr double max_gravity_share = 0.15;
/// A smaller rotation from pose to pose is not told from what registration errs by [rad].
constexpr double min_turn_rad = 0.01;
/// The lidar rests when it turns by less than this within at least this time [rad, s]: its rate is
/// then the gyro's bias. In a shorter time a slow turn could not be told from what registration
/// errs by, and would be learnt as a bias.
constexpr double max_rest_rotation_rad = 0.0015;
constexpr double min_rest_s = 1.0;
/// What is not steady for so long is no rest.
constexpr double max_rest_s = 1.3;

double seconds(std::int64_t ns) { return static_cast<double>(ns) * 1e-9; }
std::int64_t nanoseconds(double s) { return std::llround(s * 1e9); }

bool is_gravity(double acceleration) {
  return std::abs(acceleration / gravity_m_s2 - 1.0) <= max_gravity_share ||
         std::abs(acceleration - 1.0) <= max_gravity_share;
}

}  // namespace

InertialTracker::InertialTracker(const std::optional<ImuMount>& mount)
    : mount_is_known_(mount.has_value()),
      R_lidar_imu_(mount.value_or(ImuMount{}).R_lidar_imu),
      calibration_(mount.value_or(ImuMount{}).time_offset_s) {}

void InertialTracker::add(const ImuSample& sample) {
  counts_.samples += 1;
  const ImuSampleFate fate = track_.add(sample);
  counts_.not_usable += fate == ImuSampleFate::not_usable ? 1 : 0;
  counts_.out_of_order += fate == ImuSampleFate::out_of_order ? 1 : 0;
}

InertialCounts InertialTracker::counts() const {
  InertialCounts counts = counts_;
  counts.trust_losses = static_cast<std::uint64_t>(trust_.losses());
  return counts;
}

std::int64_t InertialTracker::imu_time(std::int64_t lidar_ns) const {
  return lidar_ns + nanoseconds(calibration_.time_offset_s());
}

std::optional<Eigen::Matrix3d> InertialTracker::rotation_lidar(std::int64_t from_ns,
                                                               std::int64_t to_ns) const {
  const auto R_from_to =
      track_.rotation(imu_time(from_ns), imu_time(to_ns), calibration_.bias_imu());
  if (!R_from_to) return std::nullopt;
  return (R_lidar_imu_ * *R_from_to * R_lidar_imu_.conjugate()).toRotationMatrix();
}

std::optional<InertialMotion> InertialTracker::motion(std::int64_t last_ns, std::int64_t stamp_ns,
                                                      const SweepTimes& sweep) {
  const auto newest_ns = track_.newest_ns();
  if (!newest_ns) return std::nullopt;
  const std::int64_t middle_ns = stamp_ns + nanoseconds(sweep.middle_s);
  const int steps = static_cast<int>(
      std::min<double>(max_sweep_steps, std::ceil(sweep.duration_s / sweep_step_s)));
  InertialMotion motion;
  const auto R_last_middle = rotation_lidar(last_ns, middle_ns);
  bool is_whole = R_last_middle.has_value();
  if (is_whole) motion.R_last_middle = *R_last_middle;
  for (int k = 0; k <= steps && steps > 0 && is_whole; ++k) {
    const double part = static_cast<double>(k) / steps - 0.5;
    const auto R_middle_at =
        rotation_lidar(middle_ns, middle_ns + nanoseconds(part * sweep.duration_s));
    is_whole = R_middle_at.has_value();
    if (is_whole) motion.R_middle_at.push_back(*R_middle_at);
  }
  if (!is_whole) {
    counts_.scans_without_samples += 1;
    const std::int64_t end_ns = middle_ns + nanoseconds(0.5 * sweep.duration_s);
    samples_behind_s_ = seconds(imu_time(end_ns) - *newest_ns);
    return std::nullopt;
  }
  (trust_.is_believed() ? counts_.scans_helped : counts_.scans_not_believed) += 1;
  if (!trust_.is_believed()) return std::nullopt;
  return motion;
}

UpDirection InertialTracker::up_lidar(std::int64_t time_ns) const {
  if (!mount_is_known_)
    return {.fault = "the sensor's file does not say how the IMU is fixed to the lidar ('imu')"};
  const std::int64_t from_ns = imu_time(time_ns - up_window_ns);
  auto mean = track_.steady_mean(from_ns, imu_time(time_ns));
  if (!mean || mean->duration_s < min_up_s)
    mean = track_.steady_mean(from_ns, imu_time(time_ns + up_window_after_ns));
  if (!mean)
    return {.fault =
                "the lidar was shaken or turned as the map began, the IMU sends too few "
                "samples, or takes gravity off its accelerations"};
  if (mean->duration_s < min_up_s)
    return {.fault = "its samples of the start are of less than 0.2 s"};
  if (!is_gravity(mean->acceleration_m_s2)) {
    std::ostringstream text;
    text << "it measures " << mean->acceleration_m_s2 << " m/s^2 at rest, which is not gravity";
    return {.fault = text.str()};
  }
  return {.up_lidar = R_lidar_imu_ * mean->up_imu};
}

std::optional<Eigen::Vector3d> InertialTracker::missed_by_gyro(std::int64_t from_ns,
                                                               std::int64_t to_ns,
                                                               const Eigen::Matrix3d& R_from_to) {
  const double duration_s = seconds(to_ns - from_ns);
  if (!(duration_s > 0.0)) return std::nullopt;
  const Eigen::Vector3d registered = rotation_vector(Eigen::Quaterniond(R_from_to));
  const auto last_rate = std::exchange(last_rate_lidar_, registered / duration_s);
  const auto R_gyro = rotation_lidar(from_ns, to_ns);
  if (!R_gyro) return std::nullopt;
  const Eigen::Vector3d missing =
      rotation_vector(Eigen::Quaterniond(R_gyro->transpose() * R_from_to));
  if (last_rate) trust_.add(registered, missing, registered - duration_s * *last_rate);
  if (registered.norm() > min_turn_rad) unbelieved_turn_rad_ += registered.norm();
  if (trust_.is_believed()) unbelieved_turn_rad_ = 0.0;
  return missing;
}

void InertialTracker::learn(std::int64_t from_ns, std::int64_t to_ns,
                            const Eigen::Matrix3d& R_from_to) {
  const auto missing = missed_by_gyro(from_ns, to_ns, R_from_to);
  const auto rate_from = track_.rate_at(imu_time(from_ns));
  const auto rate_to = track_.rate_at(imu_time(to_ns));
  if (!missing || !rate_from || !rate_to) return;
  (void)calibration_.learn_from_rotation(R_lidar_imu_.conjugate() * *missing,
                                         seconds(to_ns - from_ns), *rate_to - *rate_from);
  learn_at_rest(from_ns, to_ns, rotation_vector(Eigen::Quaterniond(R_from_to)));
}

void InertialTracker::learn_at_rest(std::int64_t from_ns, std::int64_t to_ns,
                                    const Eigen::Vector3d& registered) {
  // Scans of a fast lidar come too close together for a mean of their own.
  if (!rest_ || rest_->to_ns != from_ns)
    rest_ = Rest{.from_ns = from_ns, .to_ns = from_ns, .rotation = Eigen::Vector3d::Zero()};
  rest_->to_ns = to_ns;
  rest_->rotation += registered;
  if (rest_->rotation.norm() > max_rest_rotation_rad) return rest_.reset();
  const auto mean = track_.steady_mean(imu_time(rest_->from_ns), imu_time(to_ns));
  if (mean && mean->is_frozen) return rest_.reset();
  if (!mean && seconds(to_ns - rest_->from_ns) > max_rest_s) return rest_.reset();
  if (!mean || mean->duration_s < min_rest_s) return;
  calibration_.learn_at_rest(mean->angular_velocity_imu);
  rest_.reset();
}

}  // namespace stillmap
