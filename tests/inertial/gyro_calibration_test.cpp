#include "core/inertial/gyro_calibration.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace stillmap {
namespace {

TEST(GyroCalibration, FindsBiasAndDelayFromRotationsWithNoise) {
  const Eigen::Vector3d bias(0.01, -0.006, 0.004);
  constexpr double delay_s = 0.012;
  GyroCalibration calibration(0.0);
  std::mt19937 random(1);
  std::normal_distribution<double> noise(0.0, 0.0005);
  for (int k = 0; k < 200; ++k) {
    const Eigen::Vector3d change(0.3 * std::sin(k), 0.2 * std::cos(1.3 * k),
                                 0.8 * std::sin(0.7 * k));
    const Eigen::Vector3d missing = -0.1 * (bias - calibration.bias_imu()) +
                                    (delay_s - calibration.time_offset_s()) * change +
                                    Eigen::Vector3d(noise(random), noise(random), noise(random));
    EXPECT_TRUE(calibration.learn_from_rotation(missing, 0.1, change));
  }
  EXPECT_LT((calibration.bias_imu() - bias).norm(), 0.001);
  EXPECT_NEAR(calibration.time_offset_s(), delay_s, 0.0005);
}

TEST(GyroCalibration, TakesRotationsOfAShakenLidarForWhatTheyAre) {
  // Sweeps that bend make errors of half a degree, which no bias is.
  const Eigen::Vector3d bias(0.006, -0.004, 0.009);
  GyroCalibration calibration(0.0);
  std::mt19937 random(1);
  std::normal_distribution<double> error(0.0, 0.009);
  Eigen::Vector3d last = Eigen::Vector3d::Zero();
  for (int k = 0; k < 300; ++k) {
    const Eigen::Vector3d now(error(random), error(random), error(random));
    const Eigen::Vector3d change(2.0 * std::sin(k), 0.0, 0.0);
    (void)calibration.learn_from_rotation(
        -0.1 * (bias - calibration.bias_imu()) - calibration.time_offset_s() * change + now - last,
        0.1, change);
    last = now;
    EXPECT_LT(calibration.bias_imu().norm(), 0.03) << k;
  }
  EXPECT_LT((calibration.bias_imu() - bias).norm(), 0.01);
  EXPECT_LT(std::abs(calibration.time_offset_s()), 0.002);
}

TEST(GyroCalibration, LearnsTheBiasAtRestAtOnce) {
  GyroCalibration calibration(0.0);
  const Eigen::Vector3d bias(0.008, 0.002, -0.005);
  calibration.learn_at_rest(bias);
  EXPECT_LT((calibration.bias_imu() - bias).norm(), 1e-4);
}

TEST(GyroCalibration, LearnsNothingFromWhatNoBiasExplains) {
  GyroCalibration calibration(0.0);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(calibration.learn_from_rotation({0.0, 0.0, 1.0}, 0.1, Eigen::Vector3d::Zero()));
  EXPECT_FALSE(calibration.learn_from_rotation({nan, 0.0, 0.0}, 0.1, Eigen::Vector3d::Zero()));
  EXPECT_TRUE(calibration.learn_from_rotation({0.0, 0.0, 0.0}, 0.1, Eigen::Vector3d::Zero()));
  EXPECT_EQ(calibration.bias_imu(), Eigen::Vector3d(0.0, 0.0, 0.0));
}

TEST(GyroCalibration, FollowsABiasThatStepsAtRest) {
  for (const double step : {0.005, 0.03, 0.12}) {
    GyroCalibration calibration(0.0);
    const Eigen::Vector3d before(0.008, 0.002, -0.005);
    for (int k = 0; k < 60; ++k) calibration.learn_at_rest(before);
    const Eigen::Vector3d after = before + Eigen::Vector3d(0.0, step, 0.0);
    for (int k = 0; k < 5; ++k) calibration.learn_at_rest(after);
    EXPECT_LT((calibration.bias_imu() - after).norm(), 1e-3) << step;
  }
}

TEST(GyroCalibration, TakesRatesThatDifferForNoBias) {
  GyroCalibration calibration(0.0);
  const Eigen::Vector3d bias(0.008, 0.002, -0.005);
  for (int k = 0; k < 60; ++k) calibration.learn_at_rest(bias);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int k = 0; k < 20; ++k) {
    calibration.learn_at_rest(bias + Eigen::Vector3d(0.01 * (k % 7 + 1), 0.0, 0.0));
    calibration.learn_at_rest({nan, nan, nan});
    calibration.learn_at_rest({0.0, 0.0, 5.0});
  }
  for (int k = 0; k < 20; ++k) calibration.learn_at_rest({0.0, 0.0, 5.0});
  EXPECT_LT((calibration.bias_imu() - bias).norm(), 1e-6);
}

}  // namespace
}  // namespace stillmap
