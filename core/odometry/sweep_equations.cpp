#include "core/odometry/sweep_equations.hpp"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace stillmap {
namespace {

/// Residuals of a scan that fits, for the weight of the sweep's prior beside them [m].
constexpr double expected_residual_m = 0.05;

/// Neighbouring residuals err alike: beside the prior, all of a scan's count as this many.
constexpr double independent_correspondences = 100.0;

/// A turn that is not the one that points were compensated for began or ended at any moment of the
/// sweep, whose rotation differs from that since the last pose by about this share of the change,
/// and by no more than this [rad].
constexpr double turn_change_share = 0.5;
constexpr double max_turn_deviation_rad = 0.05;

/// Error of a sweep's rotation that a gyro measured [rad].
constexpr double measured_rotation_rad = 0.0005;

/// The deviation of a sweep's bend is this share of its turn, and no more than this [rad].
constexpr double bend_share = 1.0;
constexpr double max_bend_deviation_rad = 0.03;

/// How far SweepCorrection::bend is from 0 in a sweep that turns by so much.
double bend_deviation_rad(const SweepPrior& prior, const RegistrationConfig& config,
                          double turn_rad) {
  constexpr double none_rad = 1e-6;
  if (prior.rotation_is_measured || config.sweep_bend_rad == 0.0) return none_rad;
  return std::max(config.sweep_bend_rad, std::min(bend_share * turn_rad, max_bend_deviation_rad));
}

}  // namespace

PoseTangent rotated(const Eigen::Matrix3d& R, const PoseTangent& tangent) {
  PoseTangent result;
  result.head<3>() = R.lazyProduct(tangent.head<3>());
  result.tail<3>() = R.lazyProduct(tangent.tail<3>());
  return result;
}

void add_sweep_prior(const SweepPrior& prior, const OdometryResult& at,
                     const RegistrationConfig& config, NormalEquations& equations) {
  const double correspondences = std::max(1.0, equations.weights);
  // A rotation that was measured does not depend on where the pose turns out to be.
  PoseTangent share = PoseTangent::Constant(prior.duration_share);
  if (prior.rotation_is_measured) share.tail<3>().setZero();
  PoseTangent change = PoseTangent::Zero();
  if (prior.duration_share > 0.0) {
    const Eigen::Isometry3d since_last = prior.T_map_lidar_last.inverse() * at.T_map_lidar;
    change = share.cwiseProduct(twist_of(since_last)) - prior.compensated;
    if (prior.rotation_is_measured) change.tail<3>().setZero();
  }
  const PoseTangent deviation = at.sweep_correction.twist - change;
  PoseTangent weight;
  weight.head<3>().setConstant(std::pow(expected_residual_m / config.sweep_translation_m, 2));
  const double turn_change_rad = std::abs(rotated(at.T_map_lidar.linear(), change)[5]);
  const double turn_rad = std::min(turn_change_share * turn_change_rad, max_turn_deviation_rad);
  Eigen::Vector3d rotation_rad(config.sweep_tilt_rad, config.sweep_tilt_rad,
                               std::max(config.sweep_rotation_rad, turn_rad));
  if (prior.rotation_is_measured) rotation_rad.setConstant(measured_rotation_rad);
  weight.tail<3>() = (expected_residual_m * rotation_rad.cwiseInverse()).cwiseAbs2();
  weight *= correspondences / independent_correspondences;
  const PoseTangent weighted = weight.cwiseProduct(rotated(at.T_map_lidar.linear(), deviation));
  equations.hessian_sweep.diagonal().head<6>() += weight;
  equations.hessian_pose_sweep.diagonal() -= share.cwiseProduct(weight);
  equations.hessian.diagonal() += share.cwiseAbs2().cwiseProduct(weight);
  equations.gradient_sweep.head<6>() += weighted;
  equations.gradient -= share.cwiseProduct(weighted);
  const double turn_rad_in_sweep =
      std::abs(rotated(at.T_map_lidar.linear(), prior.compensated + at.sweep_correction.twist)[5]);
  const double bend_rad = bend_deviation_rad(prior, config, turn_rad_in_sweep);
  const double bend_weight =
      correspondences / independent_correspondences * std::pow(expected_residual_m / bend_rad, 2);
  equations.hessian_sweep(bend_of_sweep, bend_of_sweep) += bend_weight;
  equations.gradient_sweep[bend_of_sweep] +=
      bend_weight * (at.T_map_lidar.linear().row(2) * at.sweep_correction.bend).value();
}

SweepElimination::SweepElimination(const NormalEquations& equations) {
  const Eigen::LDLT<Eigen::Matrix<double, 7, 7>> ldlt(equations.hessian_sweep);
  by_pose_ = ldlt.solve(equations.hessian_pose_sweep.transpose());
  constant_ = ldlt.solve(equations.gradient_sweep);
}

NormalEquations SweepElimination::reduced(NormalEquations equations) const {
  equations.hessian -= equations.hessian_pose_sweep * by_pose_;
  equations.hessian = 0.5 * (equations.hessian + equations.hessian.transpose()).eval();
  equations.gradient -= equations.hessian_pose_sweep * constant_;
  return equations;
}

SweepTangent SweepElimination::step(const PoseTangent& pose_step) const {
  return -(constant_ + by_pose_ * pose_step);
}

}  // namespace stillmap
