#pragma once

#include <Eigen/Geometry>
#include <cmath>

#include "core/graph/pose_graph.hpp"

namespace stillmap {

/// kappa and tau of EdgeError::chordal, as SE-Sync takes them from an information matrix: the
/// isotropic ones with the same mean variance.
struct ChordalWeights {
  double kappa = 0.0;
  double tau = 0.0;
};

[[nodiscard]] inline ChordalWeights chordal_weights(const PoseEdge& edge) {
  const Eigen::Matrix3d translation = edge.information.topLeftCorner<3, 3>();
  const Eigen::Matrix3d rotation = edge.information.bottomRightCorner<3, 3>();
  return {1.5 / rotation.inverse().trace(), 3.0 / translation.inverse().trace()};
}

/// Rotation vector of a unit quaternion, either sign of it. Differentiable at the identity.
template <typename T>
Eigen::Matrix<T, 3, 1> rotation_vector(const Eigen::Quaternion<T>& q) {
  using std::atan2;
  using std::sqrt;
  const T sign = q.w() < T(0.0) ? T(-1.0) : T(1.0);
  const Eigen::Matrix<T, 3, 1> v = sign * q.vec();
  const T squared_sine = v.squaredNorm();
  if (squared_sine < T(1e-16)) return T(2.0) * v;
  const T sine = sqrt(squared_sine);
  return (T(2.0) * atan2(sine, sign * q.w()) / sine) * v;
}

/// Error of the motion that two poses have against the measured one, times the square root of the
/// information.
class GeodesicError {
 public:
  static constexpr int size = 6;

  explicit GeodesicError(const PoseEdge& edge)
      : q_from_to_(edge.T_from_to.linear()),
        t_from_to_(edge.T_from_to.translation()),
        root_information_(edge.information.llt().matrixU()) {}

  /// Quaternions as Eigen stores them: x, y, z, w.
  template <typename T>
  bool operator()(const T* q_from, const T* t_from, const T* q_to, const T* t_to,
                  T* residuals) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q_map_from(q_from), q_map_to(q_to);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> t_map_from(t_from), t_map_to(t_to);
    const Eigen::Quaternion<T> q_to_from = q_from_to_.conjugate().template cast<T>();
    Eigen::Matrix<T, 6, 1> error;
    const Eigen::Matrix<T, 3, 1> t_is = q_map_from.conjugate() * (t_map_to - t_map_from);
    error.template head<3>() = q_to_from * (t_is - t_from_to_.template cast<T>());
    error.template tail<3>() = rotation_vector<T>(q_to_from * (q_map_from.conjugate() * q_map_to));
    Eigen::Map<Eigen::Matrix<T, 6, 1>> out(residuals);
    out = root_information_.template cast<T>() * error;
    return true;
  }

 private:
  Eigen::Quaterniond q_from_to_;
  Eigen::Vector3d t_from_to_;
  Matrix6d root_information_;
};

/// The nine and three numbers whose squares make EdgeError::chordal.
class ChordalError {
 public:
  static constexpr int size = 12;

  explicit ChordalError(const PoseEdge& edge)
      : R_from_to_(edge.T_from_to.linear()), t_from_to_(edge.T_from_to.translation()) {
    const ChordalWeights weights = chordal_weights(edge);
    root_kappa_ = std::sqrt(weights.kappa);
    root_tau_ = std::sqrt(weights.tau);
  }

  template <typename T>
  bool operator()(const T* q_from, const T* t_from, const T* q_to, const T* t_to,
                  T* residuals) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q_map_from(q_from), q_map_to(q_to);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> t_map_from(t_from), t_map_to(t_to);
    const Eigen::Matrix<T, 3, 3> R_map_from = q_map_from.toRotationMatrix();
    Eigen::Map<Eigen::Matrix<T, 3, 3>> rotation(residuals);
    Eigen::Map<Eigen::Matrix<T, 3, 1>> translation(residuals + 9);
    rotation =
        T(root_kappa_) * (q_map_to.toRotationMatrix() - R_map_from * R_from_to_.template cast<T>());
    translation =
        T(root_tau_) * (t_map_to - t_map_from - R_map_from * t_from_to_.template cast<T>());
    return true;
  }

 private:
  Eigen::Matrix3d R_from_to_;
  Eigen::Vector3d t_from_to_;
  double root_kappa_ = 0.0;
  double root_tau_ = 0.0;
};

/// Error of the place that a node gives to its point, times the square root of the information.
class PositionError {
 public:
  static constexpr int size = 3;

  explicit PositionError(const PositionMeasurement& position)
      : point_node_(position.point_node),
        position_enu_(position.position_enu),
        root_information_(position.information.llt().matrixU()) {}

  template <typename T>
  bool operator()(const T* q_node, const T* t_node, const T* q_map, const T* t_map,
                  T* residuals) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q_map_node(q_node), q_enu_map(q_map);
    const Eigen::Map<const Eigen::Matrix<T, 3, 1>> t_map_node(t_node), t_enu_map(t_map);
    const Eigen::Matrix<T, 3, 1> point_map =
        q_map_node * point_node_.template cast<T>() + t_map_node;
    const Eigen::Matrix<T, 3, 1> error =
        q_enu_map * point_map + t_enu_map - position_enu_.template cast<T>();
    Eigen::Map<Eigen::Matrix<T, 3, 1>> out(residuals);
    out = root_information_.template cast<T>() * error;
    return true;
  }

 private:
  Eigen::Vector3d point_node_;
  Eigen::Vector3d position_enu_;
  Eigen::Matrix3d root_information_;
};

/// What a rotation tilts the vertical by, east and north, in standard deviations.
class TiltError {
 public:
  static constexpr int size = 2;

  explicit TiltError(double sigma_rad) : sigma_rad_(sigma_rad) {}

  template <typename T>
  bool operator()(const T* q_map, T* residuals) const {
    const Eigen::Map<const Eigen::Quaternion<T>> q_enu_map(q_map);
    const Eigen::Matrix<T, 3, 1> up = q_enu_map * Eigen::Matrix<T, 3, 1>(T(0.0), T(0.0), T(1.0));
    residuals[0] = up.x() / T(sigma_rad_);
    residuals[1] = up.y() / T(sigma_rad_);
    return true;
  }

 private:
  double sigma_rad_;
};

}  // namespace stillmap
