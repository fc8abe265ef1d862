#include "core/graph/pose_graph.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>
#include <stdexcept>

#include "core/graph/edge_error.hpp"
#include "core/odometry/se3.hpp"

namespace stillmap {
namespace {

PoseTangent random_tangent(std::mt19937_64& random, double translation, double rotation) {
  std::normal_distribution<double> normal;
  PoseTangent tangent;
  for (int k = 0; k < 3; ++k) tangent[k] = translation * normal(random);
  for (int k = 3; k < 6; ++k) tangent[k] = rotation * normal(random);
  return tangent;
}

/// Rounds of a circle that climbs, as odometry with noise has measured them, closed once a round.
PoseGraph noisy_rounds(int nodes_a_round, int rounds, double translation, double rotation,
                       std::vector<Eigen::Isometry3d>& truth) {
  std::mt19937_64 random(7);
  PoseGraph graph;
  for (int i = 0; i < nodes_a_round * rounds; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / nodes_a_round;
    truth.push_back(Eigen::Translation3d(20.0 * std::cos(angle), 20.0 * std::sin(angle), 0.01 * i) *
                    Eigen::AngleAxisd(angle, Eigen::Vector3d(0.1, 0.2, 1.0).normalized()));
  }
  Matrix6d information = Matrix6d::Identity();
  information.topLeftCorner<3, 3>() /= translation * translation;
  information.bottomRightCorner<3, 3>() /= rotation * rotation;
  const auto add = [&](std::size_t from, std::size_t to, bool is_loop) {
    const Eigen::Isometry3d T = truth[from].inverse() * truth[to] *
                                motion_of(random_tangent(random, translation, rotation));
    graph.edges.push_back({from, to, T, information, is_loop});
  };
  graph.T_map_node.push_back(truth.front());
  for (std::size_t i = 1; i < truth.size(); ++i) {
    add(i - 1, i, false);
    graph.T_map_node.push_back(graph.T_map_node.back() * graph.edges.back().T_from_to);
  }
  const auto round = static_cast<std::size_t>(nodes_a_round);
  for (std::size_t i = round; i < truth.size(); i += 5) add(i - round, i, true);
  return graph;
}

double rmse_m(const std::vector<Eigen::Isometry3d>& poses,
              const std::vector<Eigen::Isometry3d>& truth) {
  double sum = 0.0;
  for (std::size_t i = 0; i < truth.size(); ++i)
    sum += (poses[i].translation() - truth[i].translation()).squaredNorm();
  return std::sqrt(sum / static_cast<double>(truth.size()));
}

TEST(PoseGraph, ErrorIsZeroWhereTheMotionIsTheMeasuredOne) {
  std::mt19937_64 random(1);
  const Eigen::Isometry3d T_map_from = motion_of(random_tangent(random, 5.0, 1.0));
  const Eigen::Isometry3d T_from_to = motion_of(random_tangent(random, 5.0, 1.0));
  const PoseEdge edge{0, 1, T_from_to, Matrix6d::Identity(), false};
  for (const EdgeError error : {EdgeError::geodesic, EdgeError::chordal})
    EXPECT_NEAR(squared_error(edge, T_map_from, T_map_from * T_from_to, error), 0.0, 1e-20);
}

// For a small error the geodesic one is its information, whichever pose it is asked at.
TEST(PoseGraph, GeodesicErrorIsTheInformationOfTheDeviation) {
  std::mt19937_64 random(2);
  const Eigen::Isometry3d T_map_from = motion_of(random_tangent(random, 5.0, 1.0));
  const Eigen::Isometry3d T_from_to = motion_of(random_tangent(random, 5.0, 1.0));
  Matrix6d root = Matrix6d::Random();
  const Matrix6d information = root * root.transpose() + Matrix6d::Identity();
  const PoseEdge edge{0, 1, T_from_to, information, false};
  const PoseTangent off = random_tangent(random, 1e-4, 1e-4);
  Eigen::Isometry3d T_off = Eigen::Isometry3d::Identity();
  T_off.translation() = off.head<3>();
  T_off.linear() = so3_exp(off.tail<3>());
  const double expected = off.dot(information * off);
  EXPECT_NEAR(squared_error(edge, T_map_from, T_map_from * T_from_to * T_off, EdgeError::geodesic),
              expected, 1e-6 * expected);
}

TEST(PoseGraph, ChordalErrorIsThatOfSeSync) {
  std::mt19937_64 random(3);
  const Eigen::Isometry3d T_map_from = motion_of(random_tangent(random, 5.0, 1.0));
  const Eigen::Isometry3d T_map_to = motion_of(random_tangent(random, 5.0, 1.0));
  const Eigen::Isometry3d T = motion_of(random_tangent(random, 5.0, 1.0));
  Matrix6d information = Matrix6d::Zero();
  information.diagonal() << 1.0, 2.0, 4.0, 100.0, 200.0, 400.0;
  const double tau = 3.0 / (1.0 + 0.5 + 0.25);
  const double kappa = 3.0 / (2.0 * (0.01 + 0.005 + 0.0025));
  const double expected =
      kappa * (T_map_to.linear() - T_map_from.linear() * T.linear()).squaredNorm() +
      tau * (T_map_to.translation() - T_map_from * T.translation()).squaredNorm();
  EXPECT_NEAR(
      squared_error({0, 1, T, information, false}, T_map_from, T_map_to, EdgeError::chordal),
      expected, 1e-9 * expected);
}

TEST(PoseGraph, ClosuresTakeTheDriftOutOfRounds) {
  std::vector<Eigen::Isometry3d> truth;
  PoseGraph graph = noisy_rounds(100, 3, 0.01, 0.005, truth);
  const double before_m = rmse_m(graph.T_map_node, truth);
  const PoseGraphSolution solution = optimize(graph, {});
  EXPECT_TRUE(solution.converged);
  EXPECT_LT(solution.cost, solution.initial_cost);
  EXPECT_LT(rmse_m(solution.T_map_node, truth), 0.4 * before_m);
  EXPECT_TRUE(solution.T_map_node.front().isApprox(graph.T_map_node.front(), 1e-12));
}

// At an optimum no pose can be moved a little for less: numerical derivatives are zero.
TEST(PoseGraph, SolutionIsStationary) {
  for (const EdgeError error : {EdgeError::geodesic, EdgeError::chordal}) {
    std::vector<Eigen::Isometry3d> truth;
    PoseGraph graph = noisy_rounds(30, 2, 0.05, 0.02, truth);
    graph.T_map_node = optimize(graph, {.error = error, .cost_tolerance = 1e-14}).T_map_node;
    const double cost = cost_of(graph, error);
    constexpr double step = 1e-4;
    for (const std::size_t node : {1UL, 17UL, 59UL}) {
      for (int k = 0; k < 6; ++k) {
        const Eigen::Isometry3d kept = graph.T_map_node[node];
        const auto moved_cost = [&](double by) {
          graph.T_map_node[node] = boxplus(kept, by * PoseTangent::Unit(k));
          return cost_of(graph, error);
        };
        const double up = moved_cost(step), down = moved_cost(-step);
        graph.T_map_node[node] = kept;
        EXPECT_GT(up, cost);
        EXPECT_GT(down, cost);
        EXPECT_LT(std::abs(up - down), 0.02 * (up + down - 2.0 * cost)) << node << ' ' << k;
      }
    }
  }
}

TEST(PoseGraph, SameGraphGivesSameBits) {
  std::vector<Eigen::Isometry3d> truth;
  const PoseGraph graph = noisy_rounds(40, 2, 0.02, 0.01, truth);
  const auto one = optimize(graph, {.loop_scale = 1.0});
  const auto other = optimize(graph, {.loop_scale = 1.0});
  for (std::size_t i = 0; i < truth.size(); ++i)
    EXPECT_EQ(one.T_map_node[i].matrix(), other.T_map_node[i].matrix());
}

TEST(PoseGraph, KernelHoldsOneWrongClosureOff) {
  std::vector<Eigen::Isometry3d> truth;
  PoseGraph graph = noisy_rounds(60, 2, 0.01, 0.004, truth);
  const double clean_m = rmse_m(optimize(graph, {}).T_map_node, truth);
  PoseEdge wrong = graph.edges.back();
  wrong.from = 10;
  wrong.to = 100;
  graph.edges.push_back(wrong);
  const double with_kernel_m = rmse_m(optimize(graph, {.loop_scale = 2.5}).T_map_node, truth);
  const double without_m = rmse_m(optimize(graph, {}).T_map_node, truth);
  EXPECT_LT(with_kernel_m, 1.5 * clean_m);
  EXPECT_GT(without_m, 2.0 * with_kernel_m);
}

/// The graph of a line of nodes, a metre each, and a position of every fifth.
PoseGraph line_with_positions(const Eigen::Isometry3d& T_enu_map) {
  PoseGraph graph;
  for (std::size_t i = 0; i < 30; ++i) {
    const Eigen::Vector3d at(static_cast<double>(i), 2.0 * std::sin(0.2 * static_cast<double>(i)),
                             0);
    graph.T_map_node.emplace_back(Eigen::Translation3d(at));
    if (i > 0) {
      graph.edges.push_back({i - 1, i, graph.T_map_node[i - 1].inverse() * graph.T_map_node[i],
                             1e4 * Matrix6d::Identity(), false});
    }
    if (i % 5 != 0) continue;
    const Eigen::Vector3d point_node(0.2, -0.1, 1.0);
    graph.positions.push_back({i, point_node, T_enu_map * graph.T_map_node[i] * point_node,
                               100.0 * Eigen::Matrix3d::Identity()});
  }
  graph.T_enu_map = T_enu_map;
  return graph;
}

TEST(PoseGraph, PositionsFindWhereTheMapLies) {
  const Eigen::Isometry3d T_enu_map =
      Eigen::Translation3d(100.0, 50.0, 3.0) * Eigen::AngleAxisd(1.0, Eigen::Vector3d::UnitZ());
  PoseGraph graph = line_with_positions(T_enu_map);
  graph.T_enu_map = T_enu_map * motion_of((PoseTangent() << 0.5, -0.4, 0.2, 0, 0, 0.05).finished());
  const PoseGraphSolution solution = optimize(graph, {.position_scale = 1.5});
  EXPECT_LT((solution.T_enu_map.matrix() - T_enu_map.matrix()).norm(), 1e-4);
  for (const PositionMeasurement& position : graph.positions) {
    EXPECT_LT(squared_error(position, solution.T_map_node[position.node], solution.T_enu_map),
              1e-6);
  }
}

TEST(PoseGraph, WithinTheirSlackPositionsDoNotPull) {
  PoseGraph graph = line_with_positions(Eigen::Isometry3d::Identity());
  // Of 0.1 m each: one standard deviation is the slack.
  graph.positions[3].position_enu.y() += 0.09;
  const PoseGraphConfig slack{.position_scale = 1.5, .position_slack = 1.0};
  const auto unmoved = optimize(graph, slack).T_map_node;
  for (std::size_t i = 0; i < unmoved.size(); ++i)
    EXPECT_LT((unmoved[i].matrix() - graph.T_map_node[i].matrix()).norm(), 1e-9);
  graph.positions[3].position_enu.y() += 0.2;
  const PositionMeasurement& pulling = graph.positions[3];
  const PoseGraphSolution moved = optimize(graph, slack);
  EXPECT_LT(squared_error(pulling, moved.T_map_node[15], moved.T_enu_map),
            0.8 * squared_error(pulling, graph.T_map_node[15], graph.T_enu_map));
  // And one that is far off pulls less than one that is near.
  graph.positions[3].position_enu.y() += 100.0;
  const auto far = optimize(graph, slack).T_map_node;
  EXPECT_LT((far[15].translation() - graph.T_map_node[15].translation()).norm(), 0.05);
}

TEST(PoseGraph, FaultsOfPositionsAreNamed) {
  PoseGraph graph = line_with_positions(Eigen::Isometry3d::Identity());
  EXPECT_EQ(graph.faults(), "");
  graph.positions[0].node = 99;
  EXPECT_NE(graph.faults().find("of none of the 30 nodes"), std::string::npos);
  graph.positions[0].node = 0;
  graph.positions[1].position_enu.x() = std::nan("");
  EXPECT_NE(graph.faults().find("position of node 5 is not finite"), std::string::npos);
  graph.positions[1].position_enu.x() = 0.0;
  graph.positions[1].information.setZero();
  EXPECT_NE(graph.faults().find("not positive definite"), std::string::npos);
  EXPECT_THROW((void)optimize(graph, {}), std::invalid_argument);
}

TEST(PoseGraph, ChordalInitializationNeedsNoPoses) {
  std::vector<Eigen::Isometry3d> truth;
  PoseGraph graph = noisy_rounds(60, 3, 0.02, 0.01, truth);
  const double expected =
      optimize(graph, {.error = EdgeError::chordal, .cost_tolerance = 1e-12}).cost;
  for (std::size_t i = 1; i < graph.T_map_node.size(); ++i)
    graph.T_map_node[i] = Eigen::Isometry3d::Identity();
  graph.T_map_node = chordal_initialization(graph);
  EXPECT_LT(cost_of(graph, EdgeError::chordal), 10.0 * expected);
  const double cost = optimize(graph, {.error = EdgeError::chordal, .cost_tolerance = 1e-12}).cost;
  EXPECT_NEAR(cost, expected, 1e-6 * expected);
}

TEST(PoseGraph, RotationVectorIsThatOfTheLogarithm) {
  std::mt19937_64 random(4);
  for (int i = 0; i < 50; ++i) {
    const Eigen::Vector3d omega = random_tangent(random, 0.0, i < 25 ? 1.0 : 1e-5).tail<3>();
    const Eigen::Quaterniond q(so3_exp(omega));
    const Eigen::Vector3d expected = so3_log(so3_exp(omega));
    EXPECT_LT((rotation_vector<double>(q) - expected).norm(), 1e-9);
    const Eigen::Quaterniond other_sign(-q.w(), -q.x(), -q.y(), -q.z());
    EXPECT_LT((rotation_vector<double>(other_sign) - expected).norm(), 1e-9);
  }
}

TEST(PoseGraph, FaultsAreNamed) {
  std::vector<Eigen::Isometry3d> truth;
  const PoseGraph good = noisy_rounds(20, 1, 0.01, 0.01, truth);
  EXPECT_EQ(good.faults(), "");
  PoseGraph graph = good;
  graph.edges[3].to = 99;
  EXPECT_NE(graph.faults().find("from node 3 to 99 joins no two"), std::string::npos);
  EXPECT_THROW((void)optimize(graph, {}), std::invalid_argument);
  graph = good;
  graph.edges[3].information(0, 0) = -1.0;
  EXPECT_NE(graph.faults().find("not positive definite"), std::string::npos);
  graph = good;
  graph.T_map_node[5].translation().x() = std::nan("");
  EXPECT_NE(graph.faults().find("node 5 is not finite"), std::string::npos);
  graph = good;
  graph.edges.erase(graph.edges.begin() + 9);
  EXPECT_NE(graph.faults().find("only 10 of 20 nodes"), std::string::npos);
  EXPECT_NE(PoseGraph{}.faults(), "");
}

}  // namespace
}  // namespace stillmap
