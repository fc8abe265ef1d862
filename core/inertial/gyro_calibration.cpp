#include "core/inertial/gyro_calibration.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

/// Of rotations from scan to scan as registration finds them [rad]: at least this, and what has
/// been missing lately where that is more, as where the lidar shakes within its sweeps.
constexpr double registered_deviation_rad = 1e-3;
constexpr double missing_memory = 0.9;
/// Of the mean of rates at rest [rad/s]: registration does not show slower turns than this.
constexpr double rest_deviation_rad_s = 1e-3;
/// So many means at rest in a row that the bias does not explain, and that differ by no more than
/// this from one to the next, are those of a bias that has stepped.
constexpr int rests_after_step = 3;
constexpr double max_rest_difference_rad_s = 3.0 * rest_deviation_rad_s;
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
  if (!missing_imu.allFinite()) return false;
  squared_missing_ =
      missing_memory * squared_missing_ + (1.0 - missing_memory) * missing_imu.squaredNorm() / 3.0;
  return update(missing_imu, observation,
                std::max(registered_deviation_rad, std::sqrt(squared_missing_)));
}

void GyroCalibration::learn_at_rest(const Eigen::Vector3d& mean_rate_imu) {
  Observation observation;
  observation << Eigen::Matrix3d::Identity(), Eigen::Vector3d::Zero();
  const auto learn = [&] {
    (void)update(mean_rate_imu - bias_imu_, observation, rest_deviation_rad_s);
  };
  learn();
  // Written so that NaN is not explained.
  if ((mean_rate_imu - bias_imu_).norm() < max_rest_difference_rad_s) {
    unexplained_rests_ = 0;
    return;
  }
  const bool says_the_same =
      unexplained_rests_ > 0 &&
      (mean_rate_imu - unexplained_rate_imu_).norm() < max_rest_difference_rad_s;
  unexplained_rests_ = says_the_same ? unexplained_rests_ + 1 : 1;
  unexplained_rate_imu_ = mean_rate_imu;
  const bool may_be_bias = (mean_rate_imu.array().abs() < max_bias_rad_s).all();
  if (unexplained_rests_ < rests_after_step || !may_be_bias) return;
  forget_bias();
  learn();
  unexplained_rests_ = 0;
}

void GyroCalibration::forget_bias() {
  covariance_.topRows<3>().setZero();
  covariance_.leftCols<3>().setZero();
  covariance_.diagonal().head<3>().setConstant(max_bias_rad_s * max_bias_rad_s);
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
