#include "core/odometry/motion_trust.hpp"

#include <gtest/gtest.h>

namespace stillmap {
namespace {

constexpr double interval_s = 0.1;

Eigen::Isometry3d ahead(double metres) {
  return Eigen::Isometry3d(Eigen::Translation3d(metres, 0.0, 0.0));
}

class MotionTrusts : public testing::Test {
 protected:
  /// Scans of a robot that drives, while this is foretold; how often it was possible.
  int drive(int scans, double metres_a_scan, double foretold_m) {
    int possible = 0;
    for (int i = 0; i < scans; ++i) {
      // A driver's foot is not steady.
      const double metres = metres_a_scan * (1.0 + 0.05 * (i % 3 - 1));
      const double foretold = foretold_m * (1.0 + 0.05 * (i % 3 - 1));
      possible += trust_.is_possible(ahead(foretold), interval_s) ? 1 : 0;
      trust_.learn(ahead(metres), interval_s);
    }
    return possible;
  }

  MotionTrust trust_{MotionLimits{}};
};

TEST_F(MotionTrusts, WheelsAreBelievedThatErrByATenth) {
  EXPECT_EQ(drive(50, 0.5, 0.55), 50);
  EXPECT_TRUE(trust_.is_believed());
}

TEST_F(MotionTrusts, ADeadEncoderIsNotUntilItLives) {
  drive(20, 0.5, 0.5);
  ASSERT_TRUE(trust_.is_believed());
  drive(5, 0.5, 0.0);
  EXPECT_FALSE(trust_.is_believed());
  drive(50, 0.5, 0.0);
  EXPECT_FALSE(trust_.is_believed());
  drive(20, 0.5, 0.5);
  EXPECT_TRUE(trust_.is_believed());
}

TEST_F(MotionTrusts, AJumpIsNoMotionAndCostsNoTrust) {
  drive(20, 1.0, 1.0);
  EXPECT_EQ(drive(1, 1.0, -12.5), 0);
  EXPECT_TRUE(trust_.is_believed());
  EXPECT_EQ(drive(20, 1.0, 1.0), 20);
}

TEST_F(MotionTrusts, OneMissOfAGoodPriorCostsNoTrust) {
  drive(20, 0.5, 0.5);
  drive(1, 0.8, 0.5);
  EXPECT_TRUE(trust_.is_believed());
}

// In a tunnel nothing is registered that could tell, and wheels are all there is.
TEST_F(MotionTrusts, TrustComesBackWhereNothingTells) {
  drive(20, 0.5, 0.5);
  drive(10, 0.5, 0.0);
  ASSERT_FALSE(trust_.is_believed());
  for (int i = 0; i < 25; ++i) static_cast<void>(trust_.is_possible(ahead(0.5), interval_s));
  EXPECT_TRUE(trust_.is_believed());
}

TEST_F(MotionTrusts, ItComesBackWhereEveryMotionIsForgottenBeforeTheNext) {
  drive(20, 0.5, 0.5);
  drive(10, 0.5, 0.0);
  ASSERT_FALSE(trust_.is_believed());
  for (int i = 0; i < 22; ++i) {
    trust_.forget_motion();
    EXPECT_TRUE(trust_.is_possible(ahead(0.0), interval_s));
  }
  EXPECT_TRUE(trust_.is_believed());
}

TEST_F(MotionTrusts, WhatIsBorneGrowsWithTheTimeBetweenScans) {
  for (int i = 0; i < 20; ++i) {
    EXPECT_TRUE(trust_.is_possible(ahead(5.15), 0.5));
    trust_.learn(ahead(5.0), 0.5);
  }
  EXPECT_TRUE(trust_.is_believed());
}

// Two stamps of one moment: 1 cm of noise would be 10 m/s.
TEST_F(MotionTrusts, NoiseBetweenTwoStampsIsNoVelocity) {
  drive(20, 0.1, 0.1);
  static_cast<void>(trust_.is_possible(ahead(0.01), 0.001));
  trust_.learn(ahead(0.01), 0.001);
  EXPECT_TRUE(trust_.is_possible(ahead(0.1), interval_s));
}

// A robot that is pushed while it is not registered.
TEST_F(MotionTrusts, WhatGoesOnIsNoJump) {
  drive(20, 0.1, 0.1);
  EXPECT_FALSE(trust_.is_possible(ahead(2.0), interval_s));
  EXPECT_TRUE(trust_.is_possible(ahead(2.0), interval_s));
  EXPECT_FALSE(trust_.is_possible(ahead(50.0), interval_s));
  EXPECT_FALSE(trust_.is_possible(ahead(50.0), interval_s)) << "faster than any robot";
}

}  // namespace
}  // namespace stillmap
