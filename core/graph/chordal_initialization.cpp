#include <Eigen/Dense>
#include <Eigen/SparseCholesky>
#include <stdexcept>
#include <string>

#include "core/graph/edge_error.hpp"
#include "core/graph/pose_graph.hpp"

namespace stillmap {
namespace {

using SparseMatrix = Eigen::SparseMatrix<double>;

/// Normal equations of unknowns of `block` numbers a node, node 0 known.
class NodeEquations {
 public:
  NodeEquations(std::size_t nodes, int block, int columns)
      : block_(block),
        unknowns_(static_cast<int>(nodes - 1) * block),
        right_(Eigen::MatrixXd::Zero(unknowns_, columns)) {}

  /// Adds weight |x_to - coupling x_from - constant|^2, column by column. `known` is x of node 0.
  void add(const PoseEdge& edge, const Eigen::MatrixXd& coupling, const Eigen::MatrixXd& constant,
           double weight, const Eigen::MatrixXd& known) {
    const Eigen::MatrixXd to = Eigen::MatrixXd::Identity(block_, block_);
    const Eigen::MatrixXd from = -coupling;
    Eigen::MatrixXd rest = constant;
    if (edge.from == 0) rest -= from * known;
    if (edge.to == 0) rest -= to * known;
    add_block(edge.to, edge.to, weight * to);
    add_block(edge.from, edge.from, weight * from.transpose() * from);
    add_block(edge.from, edge.to, weight * from.transpose());
    add_block(edge.to, edge.from, weight * from);
    if (edge.to != 0) right_.middleRows(row(edge.to), block_) += weight * rest;
    if (edge.from != 0)
      right_.middleRows(row(edge.from), block_) += weight * from.transpose() * rest;
  }

  [[nodiscard]] Eigen::MatrixXd solution() const {
    SparseMatrix left(unknowns_, unknowns_);
    left.setFromTriplets(left_.begin(), left_.end());
    const Eigen::SimplicialLDLT<SparseMatrix> ldlt(left);
    if (ldlt.info() != Eigen::Success)
      throw std::invalid_argument("the graph's edges leave poses undetermined");
    return ldlt.solve(right_);
  }
  [[nodiscard]] Eigen::MatrixXd of_node(const Eigen::MatrixXd& solution, std::size_t node) const {
    return solution.middleRows(row(node), block_);
  }

 private:
  [[nodiscard]] int row(std::size_t node) const { return (static_cast<int>(node) - 1) * block_; }
  void add_block(std::size_t node_a, std::size_t node_b, const Eigen::MatrixXd& values) {
    if (node_a == 0 || node_b == 0) return;
    for (int i = 0; i < block_; ++i)
      for (int k = 0; k < block_; ++k)
        left_.emplace_back(row(node_a) + i, row(node_b) + k, values(i, k));
  }

  int block_;
  int unknowns_;
  std::vector<Eigen::Triplet<double>> left_;
  Eigen::MatrixXd right_;
};

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& matrix) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(matrix, Eigen::ComputeFullU | Eigen::ComputeFullV);
  Eigen::Matrix3d U = svd.matrixU();
  if ((U * svd.matrixV().transpose()).determinant() < 0.0) U.col(2) *= -1.0;
  return U * svd.matrixV().transpose();
}

/// Rotations of the nodes. R_to' = R' R_from' for each column of the transposed rotations.
std::vector<Eigen::Matrix3d> rotations(const PoseGraph& graph) {
  NodeEquations equations(graph.T_map_node.size(), 3, 3);
  const Eigen::Matrix3d first = graph.T_map_node.front().linear();
  for (const PoseEdge& edge : graph.edges) {
    equations.add(edge, edge.T_from_to.linear().transpose(), Eigen::Matrix3d::Zero(),
                  chordal_weights(edge).kappa, first.transpose());
  }
  const Eigen::MatrixXd relaxed = equations.solution();
  std::vector<Eigen::Matrix3d> out{first};
  for (std::size_t i = 1; i < graph.T_map_node.size(); ++i)
    out.push_back(nearest_rotation(equations.of_node(relaxed, i).transpose()));
  return out;
}

}  // namespace

std::vector<Eigen::Isometry3d> chordal_initialization(const PoseGraph& graph) {
  if (const std::string faults = graph.faults(EdgeError::chordal); !faults.empty())
    throw std::invalid_argument(faults);
  std::vector<Eigen::Isometry3d> T_map_node{graph.T_map_node.front()};
  if (graph.T_map_node.size() == 1) return T_map_node;
  const std::vector<Eigen::Matrix3d> R_map_node = rotations(graph);
  NodeEquations equations(graph.T_map_node.size(), 3, 1);
  for (const PoseEdge& edge : graph.edges) {
    equations.add(edge, Eigen::Matrix3d::Identity(),
                  R_map_node[edge.from] * edge.T_from_to.translation(), chordal_weights(edge).tau,
                  T_map_node.front().translation());
  }
  const Eigen::MatrixXd t = equations.solution();
  for (std::size_t i = 1; i < R_map_node.size(); ++i) {
    const Eigen::Vector3d t_map_node = equations.of_node(t, i);
    T_map_node.push_back(Eigen::Translation3d(t_map_node) * Eigen::Quaterniond(R_map_node[i]));
  }
  return T_map_node;
}

}  // namespace stillmap
