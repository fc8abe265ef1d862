#include "core/odometry/sweep_equations.hpp"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <random>

#include "core/odometry/correspondence.hpp"
#include "core/odometry/se3.hpp"
#include "tests/odometry/poses.hpp"

namespace stillmap {
namespace {

using test::random_pose;
using test::random_vector;

SweepCorrection moved_along_map(const Eigen::Isometry3d& T_map_lidar,
                                const SweepTangent& along_map) {
  const Eigen::Matrix3d R_lidar_map = T_map_lidar.linear().transpose();
  return {rotated(R_lidar_map, along_map.head<6>()), along_map[bend_of_sweep] * R_lidar_map.col(2)};
}

/// Distance from a plane of a point that a lidar saw while it moved so.
double distance_m(const Eigen::Vector3d& point_lidar, double part,
                  const Eigen::Isometry3d& T_map_lidar, const FittedSurface& plane,
                  const SweepTangent& motion_along_map) {
  const SweepCorrection motion = moved_along_map(T_map_lidar, motion_along_map);
  return residual(compensated(point_lidar, part, motion), T_map_lidar, plane).distances[0];
}

TEST(SweepEquations, APointsSlopesAreThePosesTimesItsSweepPartAndItsSquare) {
  constexpr double step = 1e-6;
  std::mt19937 random(1);
  for (const double part : {-0.5, -0.2, 0.0, 0.3, 0.5}) {
    const Eigen::Isometry3d T = random_pose(random, 50.0);
    const Eigen::Vector3d point = random_vector(random, 30.0);
    const FittedSurface plane{.centre_map = random_vector(random, 30.0),
                              .normals = {random_vector(random, 1.0).normalized()}};
    const PoseTangent by_pose = residual(point, T, plane).slopes[0];
    for (int axis = 0; axis < 7; ++axis) {
      const SweepTangent moved = step * SweepTangent::Unit(axis);
      const double slope =
          (distance_m(point, part, T, plane, moved) - distance_m(point, part, T, plane, -moved)) /
          (2.0 * step);
      const double expected =
          axis == bend_of_sweep ? part * part * by_pose[5] : part * by_pose[axis];
      EXPECT_NEAR(slope, expected, 1e-6) << "part " << part << ", axis " << axis;
    }
  }
}

/// What the prior adds where the sweep moves by so much more along the map's axes.
NormalEquations prior_at(const SweepPrior& prior, const Eigen::Isometry3d& T_map_lidar,
                         const SweepTangent& motion_along_map) {
  OdometryResult at;
  at.T_map_lidar = T_map_lidar;
  at.sweep_correction = moved_along_map(T_map_lidar, motion_along_map);
  NormalEquations equations;
  add_sweep_prior(prior, at, RegistrationConfig{}, equations);
  return equations;
}

TEST(SweepEquations, ThePriorsSlopesAreDifferencesOfItsGradient) {
  constexpr double step = 1e-4;
  // It turns too little for its weights to change with it.
  SweepPrior prior;
  prior.T_map_lidar_last = test::level_pose(3.0, 4.0, 0.7);
  prior.duration_share = 0.8;
  const Eigen::Isometry3d T =
      prior.T_map_lidar_last * motion_of((PoseTangent() << 1, 0, 0, 0, 0, 1e-4).finished());
  const NormalEquations at = prior_at(prior, T, SweepTangent::Zero());
  for (int axis = 0; axis < 7; ++axis) {
    const SweepTangent moved = step * SweepTangent::Unit(axis);
    const NormalEquations after = prior_at(prior, T, moved);
    const NormalEquations before = prior_at(prior, T, -moved);
    const SweepTangent by_sweep = (after.gradient_sweep - before.gradient_sweep) / (2.0 * step);
    const PoseTangent by_pose = (after.gradient - before.gradient) / (2.0 * step);
    EXPECT_TRUE(by_sweep.isApprox(at.hessian_sweep.col(axis), 1e-6)) << "axis " << axis;
    EXPECT_LT((by_pose - at.hessian_pose_sweep.col(axis)).norm(), 1e-6) << "axis " << axis;
  }
  for (int axis = 0; axis < 6; ++axis) {
    const PoseTangent xi = step * PoseTangent::Unit(axis);
    const NormalEquations after = prior_at(prior, boxplus(T, xi), SweepTangent::Zero());
    const NormalEquations before = prior_at(prior, boxplus(T, -xi), SweepTangent::Zero());
    const PoseTangent by_pose = (after.gradient - before.gradient) / (2.0 * step);
    EXPECT_NEAR(by_pose[axis], at.hessian(axis, axis), 0.01 * at.hessian(axis, axis));
  }
}

TEST(SweepEquations, WithoutTheSweepThePoseStepsAsInAllThirteenUnknowns) {
  const Eigen::Matrix<double, 20, 13> slopes = [] {
    std::mt19937 random(2);
    std::normal_distribution<double> normal;
    return Eigen::Matrix<double, 20, 13>::NullaryExpr([&] { return normal(random); }).eval();
  }();
  const Eigen::Matrix<double, 13, 13> information = slopes.transpose() * slopes;
  const Eigen::Matrix<double, 13, 1> pull =
      slopes.transpose() * Eigen::Matrix<double, 20, 1>::Ones();
  NormalEquations equations;
  equations.hessian = information.topLeftCorner<6, 6>();
  equations.hessian_pose_sweep = information.topRightCorner<6, 7>();
  equations.hessian_sweep = information.bottomRightCorner<7, 7>();
  equations.gradient = pull.head<6>();
  equations.gradient_sweep = pull.tail<7>();

  const Eigen::Matrix<double, 13, 1> expected = -information.fullPivLu().solve(pull);
  const SweepElimination sweep(equations);
  const NormalEquations pose = sweep.reduced(equations);
  const PoseTangent step = -pose.hessian.fullPivLu().solve(pose.gradient);
  EXPECT_TRUE(step.isApprox(expected.head<6>(), 1e-9));
  EXPECT_TRUE(sweep.step(step).isApprox(expected.tail<7>(), 1e-9));
}

}  // namespace
}  // namespace stillmap
