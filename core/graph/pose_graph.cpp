#include "core/graph/pose_graph.hpp"

#include <ceres/ceres.h>

#include <Eigen/Cholesky>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <string>

#include "core/graph/edge_error.hpp"

namespace stillmap {
namespace {

/// A pose as Ceres moves it.
struct NodeState {
  Eigen::Quaterniond q_map_node;
  Eigen::Vector3d t_map_node;

  explicit NodeState(const Eigen::Isometry3d& T_map_node)
      : q_map_node(T_map_node.linear()), t_map_node(T_map_node.translation()) {
    q_map_node.normalize();
  }
  [[nodiscard]] Eigen::Isometry3d pose() const {
    return Eigen::Translation3d(t_map_node) * q_map_node.normalized();
  }
};

template <typename Error>
std::unique_ptr<ceres::CostFunction> cost_function(const PoseEdge& edge) {
  return std::make_unique<ceres::AutoDiffCostFunction<Error, Error::size, 4, 3, 4, 3>>(
      new Error(edge));
}

std::unique_ptr<ceres::CostFunction> cost_function(const PoseEdge& edge, EdgeError error) {
  return error == EdgeError::geodesic ? cost_function<GeodesicError>(edge)
                                      : cost_function<ChordalError>(edge);
}

void add_edges(const PoseGraph& graph, const PoseGraphConfig& config, std::vector<NodeState>& nodes,
               ceres::Problem& problem) {
  for (const PoseEdge& edge : graph.edges) {
    ceres::LossFunction* loss = nullptr;
    if (edge.is_loop && config.loop_scale > 0.0) loss = new ceres::CauchyLoss(config.loop_scale);
    NodeState& from = nodes[edge.from];
    NodeState& to = nodes[edge.to];
    problem.AddResidualBlock(cost_function(edge, config.error).release(), loss,
                             from.q_map_node.coeffs().data(), from.t_map_node.data(),
                             to.q_map_node.coeffs().data(), to.t_map_node.data());
  }
}

/// Cauchy's kernel of what a residual's norm is above a slack; without a scale its square.
class SlackLoss : public ceres::LossFunction {
 public:
  SlackLoss(double slack, double scale) : slack_(slack), scale_(scale) {}

  /// rho, rho' and rho'' at s, the squared norm.
  void Evaluate(double s, double rho[3]) const override {
    const double norm = std::sqrt(s);
    if (norm <= slack_) {
      rho[0] = rho[1] = rho[2] = 0.0;
      return;
    }
    const double beyond = (norm - slack_) * (norm - slack_);
    const double slope = norm > 0.0 ? 1.0 - slack_ / norm : 1.0;
    const double curvature = norm > 0.0 ? 0.5 * slack_ / (norm * s) : 0.0;
    const double b = scale_ > 0.0 ? 1.0 / (scale_ * scale_) : 0.0;
    const double weight = 1.0 / (1.0 + b * beyond);
    rho[0] = b > 0.0 ? std::log1p(b * beyond) / b : beyond;
    rho[1] = weight * slope;
    rho[2] = weight * curvature - b * weight * weight * slope * slope;
  }

 private:
  double slack_;
  double scale_;
};

void add_positions(const PoseGraph& graph, const PoseGraphConfig& config,
                   std::vector<NodeState>& nodes, NodeState& map, ceres::Problem& problem) {
  double* const q_map = map.q_map_node.coeffs().data();
  for (const PositionMeasurement& position : graph.positions) {
    NodeState& node = nodes[position.node];
    using Cost = ceres::AutoDiffCostFunction<PositionError, PositionError::size, 4, 3, 4, 3>;
    problem.AddResidualBlock(new Cost(new PositionError(position)),
                             new SlackLoss(config.position_slack, config.position_scale),
                             node.q_map_node.coeffs().data(), node.t_map_node.data(), q_map,
                             map.t_map_node.data());
  }
  if (graph.positions.empty()) return;
  using Cost = ceres::AutoDiffCostFunction<TiltError, TiltError::size, 4>;
  problem.AddResidualBlock(new Cost(new TiltError(config.map_tilt_sigma_rad)), nullptr, q_map);
  problem.SetManifold(q_map, new ceres::EigenQuaternionManifold);
}

void hold_to_manifold(std::vector<NodeState>& nodes, ceres::Problem& problem) {
  for (NodeState& node : nodes) {
    double* const q = node.q_map_node.coeffs().data();
    if (problem.HasParameterBlock(q)) problem.SetManifold(q, new ceres::EigenQuaternionManifold);
  }
  problem.SetParameterBlockConstant(nodes.front().q_map_node.coeffs().data());
  problem.SetParameterBlockConstant(nodes.front().t_map_node.data());
}

/// Nodes that edges connect to node 0.
std::size_t connected_nodes(const PoseGraph& graph) {
  std::vector<std::size_t> parent(graph.T_map_node.size());
  for (std::size_t i = 0; i < parent.size(); ++i) parent[i] = i;
  const auto root_of = [&](std::size_t i) {
    while (parent[i] != i) i = parent[i] = parent[parent[i]];
    return i;
  };
  for (const PoseEdge& edge : graph.edges) parent[root_of(edge.from)] = root_of(edge.to);
  std::size_t count = 0;
  for (std::size_t i = 0; i < parent.size(); ++i) count += root_of(i) == root_of(0) ? 1U : 0U;
  return count;
}

bool is_positive(const Matrix6d& information, EdgeError error) {
  const auto has_root = [](const auto& matrix) {
    return matrix.allFinite() && matrix.llt().info() == Eigen::Success;
  };
  if (error == EdgeError::geodesic) return has_root(information);
  return has_root(Eigen::Matrix3d(information.topLeftCorner<3, 3>())) &&
         has_root(Eigen::Matrix3d(information.bottomRightCorner<3, 3>()));
}

std::string faults_of(const PoseEdge& edge, std::size_t nodes, EdgeError error) {
  if (edge.from >= nodes || edge.to >= nodes || edge.from == edge.to)
    return "joins no two of the " + std::to_string(nodes) + " nodes";
  if (!edge.T_from_to.matrix().allFinite()) return "has a motion that is not finite";
  if (!is_positive(edge.information, error))
    return "has an information matrix that is not positive definite";
  return "";
}

std::string faults_of(const PositionMeasurement& position, std::size_t nodes) {
  if (position.node >= nodes) return "is of none of the " + std::to_string(nodes) + " nodes";
  if (!position.point_node.allFinite() || !position.position_enu.allFinite())
    return "is not finite";
  if (!position.information.allFinite() || position.information.llt().info() != Eigen::Success)
    return "has an information matrix that is not positive definite";
  return "";
}

}  // namespace

std::string PoseGraph::faults(EdgeError error) const {
  constexpr std::size_t max_characters = 500;
  if (T_map_node.empty()) return "the graph has no nodes\n";
  std::string out;
  for (std::size_t i = 0; i < T_map_node.size() && out.size() < max_characters; ++i) {
    if (!T_map_node[i].matrix().allFinite())
      out += "node " + std::to_string(i) + " is not finite\n";
  }
  for (const PoseEdge& edge : edges) {
    const std::string fault = faults_of(edge, T_map_node.size(), error);
    if (fault.empty()) continue;
    if (out.size() > max_characters) return out + "and so on\n";
    out += "the edge from node " + std::to_string(edge.from) + " to " + std::to_string(edge.to) +
           " " + fault + "\n";
  }
  for (const PositionMeasurement& position : positions) {
    const std::string fault = faults_of(position, T_map_node.size());
    if (fault.empty()) continue;
    if (out.size() > max_characters) return out + "and so on\n";
    out += "a position of node " + std::to_string(position.node) + " " + fault + "\n";
  }
  if (!T_enu_map.matrix().allFinite()) out += "the map's place is not finite\n";
  if (!out.empty()) return out;
  if (const std::size_t count = connected_nodes(*this); count < T_map_node.size()) {
    out = "only " + std::to_string(count) + " of " + std::to_string(T_map_node.size()) +
          " nodes are connected to node 0\n";
  }
  return out;
}

double squared_error(const PoseEdge& edge, const Eigen::Isometry3d& T_map_from,
                     const Eigen::Isometry3d& T_map_to, EdgeError error) {
  const NodeState from(T_map_from), to(T_map_to);
  Eigen::Matrix<double, ChordalError::size, 1> residuals =
      Eigen::Matrix<double, ChordalError::size, 1>::Zero();
  const auto evaluate = [&](const auto& of_edge) {
    of_edge(from.q_map_node.coeffs().data(), from.t_map_node.data(), to.q_map_node.coeffs().data(),
            to.t_map_node.data(), residuals.data());
  };
  error == EdgeError::geodesic ? evaluate(GeodesicError(edge)) : evaluate(ChordalError(edge));
  return residuals.squaredNorm();
}

double squared_error(const PositionMeasurement& position, const Eigen::Isometry3d& T_map_node,
                     const Eigen::Isometry3d& T_enu_map) {
  const NodeState node(T_map_node), map(T_enu_map);
  Eigen::Vector3d residuals;
  PositionError error(position);
  error(node.q_map_node.coeffs().data(), node.t_map_node.data(), map.q_map_node.coeffs().data(),
        map.t_map_node.data(), residuals.data());
  return residuals.squaredNorm();
}

double cost_of(const PoseGraph& graph, EdgeError error) {
  double cost = 0.0;
  for (const PoseEdge& edge : graph.edges)
    cost += squared_error(edge, graph.T_map_node[edge.from], graph.T_map_node[edge.to], error);
  return cost;
}

PoseGraphSolution optimize(const PoseGraph& graph, const PoseGraphConfig& config) {
  if (const std::string faults = graph.faults(config.error); !faults.empty())
    throw std::invalid_argument(faults);
  if (graph.edges.empty())
    return {.T_map_node = graph.T_map_node, .T_enu_map = graph.T_enu_map, .converged = true};
  std::vector<NodeState> nodes(graph.T_map_node.begin(), graph.T_map_node.end());
  NodeState map(graph.T_enu_map);
  ceres::Problem problem;
  add_edges(graph, config, nodes, problem);
  add_positions(graph, config, nodes, map, problem);
  hold_to_manifold(nodes, problem);
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.max_num_iterations = config.max_iterations;
  options.function_tolerance = config.cost_tolerance;
  options.gradient_tolerance = 1e-12;
  options.parameter_tolerance = 1e-12;
  // Sums in another order would be another solution.
  options.num_threads = 1;
  options.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  PoseGraphSolution solution{.T_map_node = {},
                             .T_enu_map = graph.positions.empty() ? graph.T_enu_map : map.pose(),
                             .initial_cost = 2.0 * summary.initial_cost,
                             .cost = 2.0 * summary.final_cost,
                             .iterations = static_cast<int>(summary.iterations.size()),
                             .converged = summary.termination_type == ceres::CONVERGENCE};
  for (const NodeState& node : nodes) solution.T_map_node.push_back(node.pose());
  return solution;
}

}  // namespace stillmap
