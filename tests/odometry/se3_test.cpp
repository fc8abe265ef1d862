#include "core/odometry/se3.hpp"

#include <gtest/gtest.h>

#include "tests/odometry/poses.hpp"

namespace stillmap {
namespace {

using test::expect_near;
using test::random_pose;
using test::random_vector;

TEST(So3, LogUndoesExp) {
  std::mt19937 random(1);
  for (const double angle : {0.0, 1e-12, 1e-10, 1e-9, 1e-8, 1e-4, 0.5, 2.0, 3.1, M_PI - 1e-6}) {
    for (int k = 0; k < 100; ++k) {
      const Eigen::Vector3d omega = angle * random_vector(random, 1.0).normalized();
      const Eigen::Vector3d back = so3_log(so3_exp(omega));
      EXPECT_LE((back - omega).norm(), 1e-9) << "angle " << angle;
    }
  }
}

TEST(So3, ExpUndoesLogUpToHalfATurn) {
  std::mt19937 random(2);
  for (const double angle : {M_PI - 1e-9, M_PI}) {
    for (int k = 0; k < 100; ++k) {
      const Eigen::Matrix3d rotation = so3_exp(angle * random_vector(random, 1.0).normalized());
      const Eigen::Vector3d omega = so3_log(rotation);
      EXPECT_LE(omega.norm(), M_PI + 1e-9);
      // The axis may have turned round: both ways lead to the same rotation.
      EXPECT_LE((so3_exp(omega) - rotation).norm(), 1e-7);
    }
  }
}

TEST(So3, ExpIsARotationThatKeepsItsAxis) {
  std::mt19937 random(3);
  for (int k = 0; k < 200; ++k) {
    const Eigen::Vector3d omega = random_vector(random, 3.0);
    const Eigen::Matrix3d rotation = so3_exp(omega);
    EXPECT_LE((rotation * rotation.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
    EXPECT_NEAR(rotation.determinant(), 1.0, 1e-12);
    EXPECT_LE((rotation * omega - omega).norm(), 1e-12);
  }
}

TEST(So3, QuarterTurnAboutZTakesXToY) {
  const Eigen::Matrix3d rotation = so3_exp({0.0, 0.0, M_PI_2});
  EXPECT_LE((rotation * Eigen::Vector3d::UnitX() - Eigen::Vector3d::UnitY()).norm(), 1e-12);
}

TEST(Skew, IsTheCrossProduct) {
  std::mt19937 random(4);
  for (int k = 0; k < 50; ++k) {
    const Eigen::Vector3d v = random_vector(random, 10.0);
    const Eigen::Vector3d w = random_vector(random, 10.0);
    EXPECT_LE((skew(v) * w - v.cross(w)).norm(), 1e-12);
  }
}

TEST(Boxplus, MinusUndoesPlus) {
  std::mt19937 random(5);
  for (int k = 0; k < 200; ++k) {
    const Eigen::Isometry3d T = random_pose(random, 100.0);
    PoseTangent xi;
    xi.head<3>() = random_vector(random, 10.0);
    xi.tail<3>() = random_vector(random, 1.7);
    EXPECT_LE((boxminus(boxplus(T, xi), T) - xi).norm(), 1e-9);
  }
}

TEST(Boxplus, PlusUndoesMinus) {
  std::mt19937 random(6);
  for (int k = 0; k < 200; ++k) {
    const Eigen::Isometry3d a = random_pose(random, 100.0);
    const Eigen::Isometry3d b = random_pose(random, 100.0);
    expect_near(boxplus(a, boxminus(b, a)), b, 1e-9, 1e-7);
  }
}

TEST(Boxplus, StaysARotationOverManySteps) {
  std::mt19937 random(7);
  Eigen::Isometry3d T = Eigen::Isometry3d::Identity();
  for (int k = 0; k < 20'000; ++k) {
    PoseTangent xi;
    xi.head<3>() = random_vector(random, 0.1);
    xi.tail<3>() = random_vector(random, 0.1);
    T = boxplus(T, xi);
  }
  EXPECT_LE((T.linear() * T.linear().transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
}

TEST(Boxplus, DerivativeOfAMovedPointIsAsDocumented) {
  std::mt19937 random(8);
  constexpr double step = 1e-6;
  for (int k = 0; k < 100; ++k) {
    const Eigen::Isometry3d T = random_pose(random, 50.0);
    const Eigen::Vector3d p = random_vector(random, 50.0);
    Eigen::Matrix<double, 3, 6> expected;
    expected.leftCols<3>() = Eigen::Matrix3d::Identity();
    expected.rightCols<3>() = -skew(T.linear() * p);
    for (int axis = 0; axis < 6; ++axis) {
      const PoseTangent xi = step * PoseTangent::Unit(axis);
      const Eigen::Vector3d slope = (boxplus(T, xi) * p - boxplus(T, -xi) * p) / (2.0 * step);
      EXPECT_LE((slope - expected.col(axis)).norm(), 1e-6) << "axis " << axis;
    }
  }
}

TEST(ScaledMotion, NoneAndAllOfIt) {
  std::mt19937 random(9);
  for (int k = 0; k < 50; ++k) {
    const Eigen::Isometry3d T = random_pose(random, 5.0);
    expect_near(scaled_motion(T, 0.0), Eigen::Isometry3d::Identity(), 1e-12, 1e-12);
    expect_near(scaled_motion(T, 1.0), T, 1e-9, 1e-7);
  }
}

TEST(ScaledMotion, TwoHalvesOfAStraightOrTurningMotionMakeAWhole) {
  const Eigen::Isometry3d straight(Eigen::Translation3d(2.0, -1.0, 0.5));
  const Eigen::Isometry3d turning(Eigen::AngleAxisd(0.4, Eigen::Vector3d(1.0, 2.0, 2.0) / 3.0));
  for (const Eigen::Isometry3d& T : {straight, turning}) {
    const Eigen::Isometry3d half = scaled_motion(T, 0.5);
    expect_near(half * half, T, 1e-12, 1e-9);
  }
}

TEST(ScaledMotion, TwoHalvesOfACarsMotionMakeAWholeWithinACentimetre) {
  // 15 m/s and 0.2 rad/s at 10 Hz.
  const Eigen::Isometry3d T = test::level_pose(1.5, 0.01, 0.02);
  const Eigen::Isometry3d half = scaled_motion(T, 0.5);
  expect_near(half * half, T, 0.01, 1e-9);
}

}  // namespace
}  // namespace stillmap
