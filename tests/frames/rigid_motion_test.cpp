#include "core/frames/rigid_motion.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "core/odometry/se3.hpp"

namespace stillmap {
namespace {

constexpr double right_angle = std::numbers::pi / 2;

TEST(FromXyzRpy, PitchesTheNoseDown) {
  const Eigen::Isometry3d T_base_lidar = from_xyz_rpy({1.0, 2.0, 3.0}, {0.0, right_angle, 0.0});
  EXPECT_TRUE(T_base_lidar.translation().isApprox(Eigen::Vector3d(1.0, 2.0, 3.0)));
  EXPECT_TRUE((T_base_lidar.linear() * Eigen::Vector3d::UnitX())
                  .isApprox(-Eigen::Vector3d::UnitZ(), 1e-12));
}

TEST(FromXyzRpy, TurnsAboutFixedAxesRollFirst) {
  const Eigen::Isometry3d T = from_xyz_rpy({0.0, 0.0, 0.0}, {right_angle, 0.0, right_angle});
  EXPECT_TRUE((T.linear() * Eigen::Vector3d::UnitY()).isApprox(Eigen::Vector3d::UnitZ(), 1e-12));
  EXPECT_TRUE((T.linear() * Eigen::Vector3d::UnitX()).isApprox(Eigen::Vector3d::UnitY(), 1e-12));
}

TEST(Heading, IsTheTurnAboutTheVerticalOfWhatDoesNotLean) {
  for (const double yaw : {-3.0, -0.4, 0.0, 1.2, 3.1})
    EXPECT_NEAR(heading_rad(from_xyz_rpy({1.0, 2.0, 3.0}, {0.0, 0.0, yaw})), yaw, 1e-12);
}

TEST(Heading, IsThatOfTheNoseHoweverItIsHeld) {
  EXPECT_NEAR(heading_rad(from_xyz_rpy({0.0, 0.0, 0.0}, {0.3, -0.2, 1.2})), 1.2, 1e-12);
}

TEST(MotionOfFrame, SwingsALidarAheadOfATurningBase) {
  const Eigen::Isometry3d T_base_lidar = from_xyz_rpy({1.0, 0.0, 0.0}, {0.0, 0.0, 0.0});
  const Eigen::Isometry3d turn = from_xyz_rpy({0.0, 0.0, 0.0}, {0.0, 0.0, right_angle});
  const Eigen::Isometry3d motion_lidar = motion_of_frame(T_base_lidar.inverse(), turn);
  EXPECT_TRUE(motion_lidar.translation().isApprox(Eigen::Vector3d(-1.0, 1.0, 0.0), 1e-12));
}

TEST(MotionOfFrame, TurnsTheMotionOfALidarThatLooksSideways) {
  const Eigen::Isometry3d T_base_lidar = from_xyz_rpy({1.0, 0.0, 0.0}, {0.0, 0.0, right_angle});
  const Eigen::Isometry3d ahead = from_xyz_rpy({2.0, 0.0, 0.0}, {0.0, 0.0, 0.0});
  const Eigen::Isometry3d motion_lidar = motion_of_frame(T_base_lidar.inverse(), ahead);
  EXPECT_TRUE(motion_lidar.translation().isApprox(Eigen::Vector3d(0.0, -2.0, 0.0), 1e-12));
}

TEST(CovarianceOfFrame, AgreesWithErrorsThatAreMoved) {
  const Eigen::Isometry3d T_map_a = from_xyz_rpy({4.0, -3.0, 1.0}, {0.3, -0.7, 2.0});
  const Eigen::Isometry3d T_a_b = from_xyz_rpy({1.2, 0.4, -0.8}, {0.1, 0.26, -1.5});
  const Eigen::Matrix<double, 6, 6> root = Eigen::Matrix<double, 6, 6>::Random();
  const Eigen::Matrix<double, 6, 6> covariance_a = root * root.transpose();
  // Column k: the error of b that the k-th unit error of a makes.
  Eigen::Matrix<double, 6, 6> jacobian;
  constexpr double step = 1e-6;
  for (int k = 0; k < 6; ++k) {
    const PoseTangent error = step * PoseTangent::Unit(k);
    jacobian.col(k) = boxminus(boxplus(T_map_a, error) * T_a_b, T_map_a * T_a_b) / step;
  }
  const Eigen::Matrix<double, 6, 6> expected = jacobian * covariance_a * jacobian.transpose();
  EXPECT_TRUE(covariance_of_frame(covariance_a, T_map_a, T_a_b).isApprox(expected, 1e-4));
}

TEST(CovarianceOfFrame, IsTheSameForTheSameFrame) {
  const Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Random();
  EXPECT_EQ(covariance_of_frame(covariance, from_xyz_rpy({1, 2, 3}, {1, 2, 3}),
                                Eigen::Isometry3d::Identity()),
            covariance);
}

TEST(LevellingRotation, IsTheLeastTurnThatTakesUpToZ) {
  std::mt19937 random(7);
  std::normal_distribution<double> normal;
  for (int i = 0; i < 200; ++i) {
    // Some of them nearly upside down.
    const double scale = std::pow(10.0, -(i % 10));
    const Eigen::Vector3d up =
        Eigen::Vector3d(scale * normal(random), scale * normal(random), i % 3 == 0 ? 1.0 : -1.0)
            .normalized();
    const Eigen::Matrix3d R = levelling_rotation(up);
    EXPECT_LT((R * up - Eigen::Vector3d::UnitZ()).norm(), 1e-9) << up.transpose();
    const Eigen::Matrix3d expected =
        Eigen::Quaterniond::FromTwoVectors(up, Eigen::Vector3d::UnitZ()).toRotationMatrix();
    const double angle = Eigen::AngleAxisd(expected).angle();
    EXPECT_NEAR(Eigen::AngleAxisd(R).angle(), angle, 1e-6) << up.transpose();
  }
  EXPECT_EQ(levelling_rotation(Eigen::Vector3d::UnitZ()), Eigen::Matrix3d::Identity());
  EXPECT_EQ(levelling_rotation(-Eigen::Vector3d::UnitZ()) * -Eigen::Vector3d::UnitZ(),
            Eigen::Vector3d::UnitZ());
}

TEST(TurnedCovariance, IsThatOfTheTurnedVector) {
  const Eigen::Matrix<double, 6, 6> root = Eigen::Matrix<double, 6, 6>::Random();
  const Eigen::Matrix<double, 6, 6> covariance = root * root.transpose();
  const Eigen::Matrix3d R_a_b = from_xyz_rpy({0.0, 0.0, 0.0}, {0.3, -0.7, 2.0}).linear();
  Eigen::Matrix<double, 6, 6> turn = Eigen::Matrix<double, 6, 6>::Zero();
  turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = R_a_b;
  EXPECT_TRUE(
      turned_covariance(covariance, R_a_b).isApprox(turn * covariance * turn.transpose(), 1e-12));
}

TEST(TurnedCovariance, SwapsAxes) {
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  covariance.diagonal() << 1.0, 2.0, 3.0, 4.0, 5.0, 6.0;
  const Eigen::Matrix3d R_a_b = from_xyz_rpy({0.0, 0.0, 0.0}, {0.0, 0.0, right_angle}).linear();
  PoseTangent expected;
  expected << 2.0, 1.0, 3.0, 5.0, 4.0, 6.0;
  EXPECT_TRUE(turned_covariance(covariance, R_a_b).diagonal().isApprox(expected, 1e-12));
}

}  // namespace
}  // namespace stillmap
