#pragma once

#include <Eigen/Core>

namespace stillmap {

/// Estimates a gyro's bias and the delay of its stamps from rotations that are known otherwise: a
/// Kalman filter of four states.
class GyroCalibration {
 public:
  explicit GyroCalibration(double time_offset_s) : time_offset_s_(time_offset_s) {}

  /// Along the gyro's axes [rad/s].
  [[nodiscard]] const Eigen::Vector3d& bias_imu() const { return bias_imu_; }
  /// Time by which the gyro's stamps are late [s].
  [[nodiscard]] double time_offset_s() const { return time_offset_s_; }

  /// The gyro has rotated less by `missing_imu` [rad] within `duration_s` than it should have,
  /// while its rate changed by `rate_change_imu` [rad/s] from start to end. Returns false for what
  /// no bias and no delay explain: nothing is learnt from that.
  bool learn_from_rotation(const Eigen::Vector3d& missing_imu, double duration_s,
                           const Eigen::Vector3d& rate_change_imu);

  /// The gyro measured this while it did not turn. What the bias so far does not explain is learnt
  /// once several times in a row say the same: the bias has stepped.
  void learn_at_rest(const Eigen::Vector3d& mean_rate_imu);

 private:
  using State = Eigen::Vector4d;
  using Covariance = Eigen::Matrix4d;
  using Observation = Eigen::Matrix<double, 3, 4>;

  /// `observation` times the state's error explains `missing`, but for noise of `deviation`.
  bool update(const Eigen::Vector3d& missing, const Observation& observation, double deviation);
  /// The bias may be any, again.
  void forget_bias();

  Eigen::Vector3d bias_imu_ = Eigen::Vector3d::Zero();
  double time_offset_s_;
  /// 1 degree a second and 20 ms.
  Covariance covariance_ = State(3e-4, 3e-4, 3e-4, 4e-4).asDiagonal();
  /// Mean square of what was missing lately, of one axis [rad^2]; at first that of half a degree.
  double squared_missing_ = 7.6e-5;
  /// At rest, since one was explained: the last mean rate that was not, and how many say the same.
  Eigen::Vector3d unexplained_rate_imu_ = Eigen::Vector3d::Zero();
  int unexplained_rests_ = 0;
};

}  // namespace stillmap
