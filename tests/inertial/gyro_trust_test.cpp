#include "core/inertial/gyro_trust.hpp"

#include <gtest/gtest.h>

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
