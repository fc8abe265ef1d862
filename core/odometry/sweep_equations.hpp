#pragma once

#include <Eigen/Core>

#include "core/odometry/registration.hpp"

namespace stillmap {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// Motion within a sweep along the map's axes: its twist, and its bend about the map's z.
using SweepTangent = Eigen::Matrix<double, 7, 1>;
constexpr int bend_of_sweep = 6;

/// J'WJ and J'We of eq. (13) over the correspondences whose residual is valid. A point's derivative
/// by the sweep's twist is its sweep part times that by the pose; by the bend, its square times
/// that by the pose's rotation about z.
struct NormalEquations {
  Matrix6d hessian = Matrix6d::Zero();
  Eigen::Matrix<double, 6, 7> hessian_pose_sweep = Eigen::Matrix<double, 6, 7>::Zero();
  Eigen::Matrix<double, 7, 7> hessian_sweep = Eigen::Matrix<double, 7, 7>::Zero();
  PoseTangent gradient = PoseTangent::Zero();
  SweepTangent gradient_sweep = SweepTangent::Zero();
  double weighted_squares = 0.0;
  double weights = 0.0;
  /// Sum of w (|p|^2 I - p p') over the points' arms p from the lidar, along the map's axes [m^2].
  Eigen::Matrix3d arms = Eigen::Matrix3d::Zero();
  /// Sum of the features' scores (OdometryResult::fit), and of those that lie on no level plane.
  double scores = 0.0;
  double upright_scores = 0.0;
  int on_level_planes = 0;
  int edges = 0;
  int planes = 0;

  [[nodiscard]] int count() const { return edges + planes; }
};

/// `tangent` along other axes.
[[nodiscard]] PoseTangent rotated(const Eigen::Matrix3d& R, const PoseTangent& tangent);

/// Adds the prior of the motion within the sweep, along the map's axes.
void add_sweep_prior(const SweepPrior& prior, const OdometryResult& at,
                     const RegistrationConfig& config, NormalEquations& equations);

/// The sweep's motion taken out of the equations (Schur's complement).
class SweepElimination {
 public:
  explicit SweepElimination(const NormalEquations& equations);

  /// The equations of the pose alone.
  [[nodiscard]] NormalEquations reduced(NormalEquations equations) const;
  /// Step of the sweep's motion along the map's axes.
  [[nodiscard]] SweepTangent step(const PoseTangent& pose_step) const;

 private:
  Eigen::Matrix<double, 7, 6> by_pose_;
  SweepTangent constant_;
};

}  // namespace stillmap
