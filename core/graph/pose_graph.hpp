#pragma once

#include <Eigen/Geometry>
#include <cstddef>
#include <string>
#include <vector>

namespace stillmap {

using Matrix6d = Eigen::Matrix<double, 6, 6>;

/// A measured motion from one node of a pose graph to another.
struct PoseEdge {
  std::size_t from = 0;
  std::size_t to = 0;
  Eigen::Isometry3d T_from_to = Eigen::Isometry3d::Identity();
  /// Inverse covariance of the error (translation [m], rotation vector [rad]) of T_from_to, along
  /// the axes of `to`.
  Matrix6d information = Matrix6d::Identity();
  /// It may be wrong: it gets the robust kernel.
  bool is_loop = false;
};

/// A measured place of a point that is fixed to a node, in a frame of its own whose z points up
/// (east, north and up somewhere on the earth). Where the map lies in that frame is found with the
/// poses.
struct PositionMeasurement {
  std::size_t node = 0;
  Eigen::Vector3d point_node = Eigen::Vector3d::Zero();
  Eigen::Vector3d position_enu = Eigen::Vector3d::Zero();
  /// Inverse covariance of position_enu.
  Eigen::Matrix3d information = Eigen::Matrix3d::Identity();
};

/// What the error of an edge is.
enum class EdgeError {
  /// The six numbers of PoseEdge::information.
  geodesic,
  /// kappa |R_to - R_from R|^2 + tau |t_to - t_from - R_from t|^2, the cost of SE-Sync (D. Rosen et
  /// al., "SE-Sync", IJRR 2019), whose optimum can be certified.
  /// Takes of PoseEdge::information what its blocks of translation and rotation say.
  chordal,
};

/// Poses and the motions measured between them. Node 0 stays where it is.
struct PoseGraph {
  std::vector<Eigen::Isometry3d> T_map_node;
  std::vector<PoseEdge> edges;
  std::vector<PositionMeasurement> positions;
  /// Where the search for it begins; of use where there are positions.
  Eigen::Isometry3d T_enu_map = Eigen::Isometry3d::Identity();

  /// The first faults in words, one a line: edges and positions of nodes that are not there,
  /// numbers that are not finite, information that is not positive definite (of `chordal`: its two
  /// blocks), nodes that no edges connect to node 0.
  [[nodiscard]] std::string faults(EdgeError error = EdgeError::geodesic) const;
};

struct PoseGraphConfig {
  EdgeError error = EdgeError::geodesic;
  /// Scale of the Cauchy kernel on loop edges, in standard deviations; 0: none.
  double loop_scale = 0.0;
  /// The same on positions, of what they are off beyond `position_slack` [standard deviations]:
  /// within it nothing pulls. A receiver errs by the same for a minute, and a map that agrees with
  /// it is not to be bent after that.
  double position_scale = 0.0;
  double position_slack = 0.0;
  /// How well the map is level, for positions that say little of it [rad].
  double map_tilt_sigma_rad = 0.02;
  int max_iterations = 200;
  /// Converged when a step changes the cost by less than this share.
  double cost_tolerance = 1e-9;
};

struct PoseGraphSolution {
  std::vector<Eigen::Isometry3d> T_map_node;
  /// That of the graph where it has no positions.
  Eigen::Isometry3d T_enu_map = Eigen::Isometry3d::Identity();
  /// Before and after, by `cost_of` with the kernel, and what the positions add.
  double initial_cost = 0.0;
  double cost = 0.0;
  int iterations = 0;
  bool converged = false;
};

/// Squared error of one edge, without a kernel.
[[nodiscard]] double squared_error(const PoseEdge& edge, const Eigen::Isometry3d& T_map_from,
                                   const Eigen::Isometry3d& T_map_to, EdgeError error);

/// Of a position, without a kernel: in squared standard deviations.
[[nodiscard]] double squared_error(const PositionMeasurement& position,
                                   const Eigen::Isometry3d& T_map_node,
                                   const Eigen::Isometry3d& T_enu_map);

/// Sum of the squared errors of all edges, without a kernel: chi^2, or the cost of SE-Sync.
[[nodiscard]] double cost_of(const PoseGraph& graph, EdgeError error);

/// Minimises the cost from the poses that the graph has (Levenberg-Marquardt of Ceres on the
/// manifold of poses); with positions their cost, too, over T_enu_map as well. The same graph gives
/// the same solution. Throws std::invalid_argument with `graph.faults(config.error)`.
[[nodiscard]] PoseGraphSolution optimize(const PoseGraph& graph, const PoseGraphConfig& config);

/// Poses from the edges alone, whatever poses the graph has: rotations that minimise the chordal
/// error without being held to be rotations, projected, then translations by them (L. Carlone et
/// al., "Initialization techniques for 3D SLAM", ICRA 2015). From there the optimum is found on
/// graphs whose stored poses lead to a local one. Throws std::invalid_argument with
/// `graph.faults(EdgeError::chordal)`.
[[nodiscard]] std::vector<Eigen::Isometry3d> chordal_initialization(const PoseGraph& graph);

}  // namespace stillmap
