#pragma once

#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <string>

#include "core/inertial/gyro_calibration.hpp"
#include "core/inertial/gyro_trust.hpp"
#include "core/inertial/imu_track.hpp"
#include "core/inertial/inertial_motion.hpp"
#include "core/lidar/imu_mount.hpp"
#include "core/lidar/prepare.hpp"

namespace stillmap {

/// What has become of an IMU's samples.
struct InertialCounts {
  std::uint64_t samples = 0;
  std::uint64_t not_usable = 0;
  std::uint64_t out_of_order = 0;
  /// Scans whose rotation the IMU told; that samples were missing for, as they came too late, had a
  /// gap, said the same again and again or were at the end of the gyro's range; and whose rotation
  /// it was not believed to tell.
  std::uint64_t scans_helped = 0;
  std::uint64_t scans_without_samples = 0;
  std::uint64_t scans_not_believed = 0;
  /// How often the gyro was no longer believed (see GyroTrust).
  std::uint64_t trust_losses = 0;
};

/// Which way is up by an IMU at rest, or why it does not tell.
struct UpDirection {
  /// Unit vector against gravity along the lidar's axes.
  std::optional<Eigen::Vector3d> up_lidar{};
  /// Empty where it tells.
  std::string fault{};
};

/// Follows an IMU that is fixed to the lidar: tells the lidar's rotation and which way is up, and
/// learns bias and delay from the poses that are found. Times are the lidar's. Reads no clock.
class InertialTracker {
 public:
  explicit InertialTracker(const std::optional<ImuMount>& mount);

  void add(const ImuSample& sample);

  /// The lidar's rotation from `last_ns` to the middle of a sweep, and within it. Nothing where
  /// samples are missing, or before the gyro is believed.
  [[nodiscard]] std::optional<InertialMotion> motion(std::int64_t last_ns, std::int64_t stamp_ns,
                                                     const SweepTimes& sweep);

  /// From up to half a second before this time and, where that is too short, from what is at hand
  /// of the tenths of a second after it. Nothing where the lidar was shaken or turned, where what
  /// is measured is not gravity, or where the mount is not known.
  [[nodiscard]] UpDirection up_lidar(std::int64_t time_ns) const;
  /// Samples up to so long after it are looked at.
  static constexpr std::int64_t up_window_after_ns = 300'000'000;
  /// Whether the mount is known, without which no sample tells.
  [[nodiscard]] bool may_tell_up() const { return mount_is_known_; }

  /// The lidar's rotation between two times was found by registration.
  void learn(std::int64_t from_ns, std::int64_t to_ns, const Eigen::Matrix3d& R_from_to);
  /// The same where the pose is in some doubt: it tells whether the gyro is to be believed, but not
  /// its bias and delay. A gyro that warps the scans leaves no other poses.
  void judge(std::int64_t from_ns, std::int64_t to_ns, const Eigen::Matrix3d& R_from_to) {
    (void)missed_by_gyro(from_ns, to_ns, R_from_to);
  }

  /// The next pose does not go on from the last one that was learnt.
  void forget_motion() {
    last_rate_lidar_.reset();
    rest_.reset();
  }

  /// Scans cannot be registered: the gyro has to prove itself again.
  void withdraw_belief() { trust_.withdraw(); }

  /// False before the first sample.
  [[nodiscard]] bool has_samples() const { return counts_.samples > 0; }
  [[nodiscard]] bool is_believed() const { return trust_.is_believed(); }
  /// How far the lidar has turned, while there were samples, since the gyro is not believed [rad].
  [[nodiscard]] double unbelieved_turn_rad() const { return unbelieved_turn_rad_; }
  /// By how much the newest sample was before the end of the last sweep that samples were missing
  /// for [s]; negative: after it. Nothing without such a sweep.
  [[nodiscard]] std::optional<double> samples_behind_s() const { return samples_behind_s_; }
  [[nodiscard]] const GyroCalibration& calibration() const { return calibration_; }
  [[nodiscard]] InertialCounts counts() const;

  /// What the IMU's stamps say at this time.
  [[nodiscard]] std::int64_t imu_time(std::int64_t lidar_ns) const;

 private:
  [[nodiscard]] std::optional<Eigen::Matrix3d> rotation_lidar(std::int64_t from_ns,
                                                              std::int64_t to_ns) const;
  /// What the gyro misses of a rotation, which is judged by it; nothing where samples are missing.
  std::optional<Eigen::Vector3d> missed_by_gyro(std::int64_t from_ns, std::int64_t to_ns,
                                                const Eigen::Matrix3d& R_from_to);
  /// Poses of which the second one is turned by `registered` [rad].
  void learn_at_rest(std::int64_t from_ns, std::int64_t to_ns, const Eigen::Vector3d& registered);

  bool mount_is_known_;
  Eigen::Quaterniond R_lidar_imu_;
  ImuTrack track_;
  GyroCalibration calibration_;
  GyroTrust trust_;
  InertialCounts counts_;
  double unbelieved_turn_rad_ = 0.0;
  std::optional<double> samples_behind_s_;
  /// Mean rate of turn between the last two poses [rad/s].
  std::optional<Eigen::Vector3d> last_rate_lidar_;
  /// Poses in a row that hardly turned, until they are far enough apart to learn from.
  struct Rest {
    std::int64_t from_ns = 0;
    std::int64_t to_ns = 0;
    Eigen::Vector3d rotation = Eigen::Vector3d::Zero();
  };
  std::optional<Rest> rest_;
};

}  // namespace stillmap
