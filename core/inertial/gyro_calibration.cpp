#include "core/inertial/gyro_calibration.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

/// Of rotations from scan to scan as registration finds them [rad].
constexpr double registered_deviation_rad = 1e-3;
/// Of the mean of rates at rest [rad/s].
constexpr double rest_deviation_rad_s = 5e-4;
/// Bias and delay wander by this much in a second: variances [rad^2/s^2, s^2].
constexpr double bias_drift = 1e-9;
constexpr double offset_drift = 1e-9;
/// Squared standard deviations beyond which a rotation is explained by something else.
constexpr double max_squared_deviations = 25.0;
/// Larger ones are of a broken gyro, or of another clock.
constexpr double max_bias_rad_s = 0.2;
constexpr double max_offset_s = 0.15;

}  // namespace

bool GyroCalibration::learn_from_rotation(const Eigen::Vector3d& missing_imu, double duration_s,
                                          const Eigen::Vector3d& rate_change_imu) {
  covariance_.diagonal().head<3>().array() += bias_drift * duration_s;
  covariance_(3, 3) += offset_drift * duration_s;
  Observation observation;
  observation << -duration_s * Eigen::Matrix3d::Identity(), rate_change_imu;
  return update(missing_imu, observation, registered_deviation_rad);
}

void GyroCalibration::learn_at_rest(const Eigen::Vector3d& mean_rate_imu) {
  Observation observation;
  observation << Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero();
  (void)update(mean_rate_imu - bias_imu_, observation, rest_deviation_rad_s);
}

bool GyroCalibration::update(const Eigen::Vector3d& missing, const Observation& observation,
                             double deviation) {
  const Eigen::Matrix3d innovation = observation * covariance_ * observation.transpose() +
                                     deviation * deviation * Eigen::Matrix3d::Identity();
  const Eigen::LDLT<Eigen::Matrix3d> ldlt(innovation);
  // Written so that NaN fails.
  if (!(missing.dot(ldlt.solve(missing)) < max_squared_deviations)) return false;
  const Eigen::Matrix<double, 4, 3> gain = ldlt.solve(observation * covariance_).transpose();
  const State correction = gain * missing;
  bias_imu_ = (bias_imu_ + correction.head<3>()).cwiseMax(-max_bias_rad_s).cwiseMin(max_bias_rad_s);
  time_offset_s_ = std::clamp(time_offset_s_ + correction[3], -max_offset_s, max_offset_s);
  covariance_ = (Covariance::Identity() - gain * observation) * covariance_;
  covariance_ = 0.5 * (covariance_ + covariance_.transpose()).eval();
  return true;
}

}  // namespace stillmap
