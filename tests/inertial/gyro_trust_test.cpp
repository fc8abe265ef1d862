#include "core/inertial/gyro_trust.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

namespace stillmap {
namespace {

constexpr double deg = 0.0174533;

/// A robot that turns now and then, with a gyro that tells `factor` of it.
void drive(GyroTrust& trust, double factor, int scans) {
  Eigen::Vector3d last = Eigen::Vector3d::Zero();
  for (int k = 0; k < scans; ++k) {
    const Eigen::Vector3d rotation(0.0, 0.0, k % 10 < 5 ? 5.0 * deg : 0.0);
    trust.add(rotation, (1.0 - factor) * rotation, rotation - last);
    last = rotation;
  }
}

TEST(GyroTrust, NeedsARotationThatWasForetold) {
  GyroTrust trust;
  for (int k = 0; k < 100; ++k)
    trust.add(0.02 * deg * Eigen::Vector3d::Random(), 0.02 * deg * Eigen::Vector3d::Random(),
              0.03 * deg * Eigen::Vector3d::Random());
  EXPECT_FALSE(trust.is_believed());
  drive(trust, 0.99, 3);
  EXPECT_TRUE(trust.is_believed());
}

TEST(GyroTrust, NeverBelievesOtherUnitsSignsOrSilence) {
  for (const double factor : {57.3, 1.0 / 57.3, -1.0, 0.0}) {
    GyroTrust trust;
    drive(trust, factor, 200);
    EXPECT_FALSE(trust.is_believed()) << factor;
    EXPECT_EQ(trust.losses(), 0);
  }
}

/// A lidar that is swung to and fro three times a second, by which its sweeps are bent as long as
/// the gyro does not straighten them: what is registered errs by 1.2 degrees.
void shake(GyroTrust& trust, double factor, int scans) {
  std::mt19937 random(3);
  std::normal_distribution<double> error(0.0, 0.7 * deg);
  Eigen::Vector3d last = Eigen::Vector3d::Zero();
  for (int k = 0; k < scans; ++k) {
    const Eigen::Vector3d rotation(3.0 * deg * std::sin(0.6 * M_PI * k), 0.0, 0.0);
    const Eigen::Vector3d registered =
        rotation + Eigen::Vector3d(error(random), error(random), error(random));
    trust.add(registered, registered - factor * rotation, registered - last);
    last = registered;
  }
}

TEST(GyroTrust, BelievesAGyroThatForetellsWhatShakesTheLidar) {
  GyroTrust trust;
  shake(trust, 1.0, 100);
  EXPECT_TRUE(trust.is_believed());
  for (const double factor : {57.3, 1.0 / 57.3, -1.0, 0.0, 0.5, 1.3}) {
    GyroTrust wrong;
    shake(wrong, factor, 200);
    EXPECT_FALSE(wrong.is_believed()) << factor;
  }
}

/// Every 6 s it turns on the spot by 90 degrees, at full rate within 0.2 s: all that repetition
/// misses is where turns set in and end.
void turn_smoothly(GyroTrust& trust, double factor, int scans) {
  std::mt19937 random(1);
  std::normal_distribution<double> error(0.0, 0.05 * deg);
  Eigen::Vector3d last = Eigen::Vector3d::Zero();
  for (int k = 0; k < scans; ++k) {
    const int phase = k % 60;
    const double share =
        phase < 30 || phase > 44 ? 0.0 : std::min({(phase - 29) / 2.0, 1.0, (45 - phase) / 2.0});
    const Eigen::Vector3d rotation(0.0, 0.0, 6.0 * deg * share);
    const Eigen::Vector3d registered =
        rotation + Eigen::Vector3d(error(random), error(random), error(random));
    trust.add(registered, registered - factor * rotation, registered - last);
    last = registered;
  }
}

TEST(GyroTrust, IsNotWonByTheOnsetOfATurnThatItGetsWrong) {
  for (const double factor : {0.72, 0.8, 1.2, 1.3, 1.6}) {
    GyroTrust trust;
    turn_smoothly(trust, factor, 600);
    EXPECT_FALSE(trust.is_believed()) << factor;
    EXPECT_EQ(trust.losses(), 0) << factor;
  }
  GyroTrust right;
  turn_smoothly(right, 1.0, 60);
  EXPECT_TRUE(right.is_believed());
}

TEST(GyroTrust, IsNotWonByTheNoiseOfALidarThatRests) {
  GyroTrust trust;
  std::mt19937 random(3);
  std::normal_distribution<double> error(0.0, 0.3 * deg);
  Eigen::Vector3d last = Eigen::Vector3d::Zero(), last_pose = last;
  for (int k = 0; k < 500; ++k) {
    const Eigen::Vector3d pose(error(random), error(random), error(random));
    const Eigen::Vector3d registered = pose - last_pose;
    trust.add(registered, registered, registered - last);
    EXPECT_FALSE(trust.is_believed()) << k;
    last = registered;
    last_pose = pose;
  }
}

TEST(GyroTrust, IsLostOnceTheGyroIsWrongAndComesBackWithIt) {
  GyroTrust trust;
  drive(trust, 1.0, 20);
  ASSERT_TRUE(trust.is_believed());
  drive(trust, 0.0, 20);
  EXPECT_FALSE(trust.is_believed());
  EXPECT_EQ(trust.losses(), 1);
  drive(trust, 1.0, 100);
  EXPECT_TRUE(trust.is_believed());
}

TEST(GyroTrust, IsWithdrawnUntilItIsProvedAgain) {
  GyroTrust trust;
  trust.withdraw();
  EXPECT_EQ(trust.losses(), 0) << "there was none";
  drive(trust, 1.0, 20);
  ASSERT_TRUE(trust.is_believed());
  trust.withdraw();
  EXPECT_FALSE(trust.is_believed());
  EXPECT_EQ(trust.losses(), 1);
  drive(trust, 1.0, 20);
  EXPECT_TRUE(trust.is_believed());
}

}  // namespace
}  // namespace stillmap
