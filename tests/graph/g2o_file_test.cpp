#include "core/graph/g2o_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "core/dataset/dataset_error.hpp"
#include "core/odometry/se3.hpp"
#include "tests/scratch_folder.hpp"

namespace stillmap {
namespace {

namespace fs = std::filesystem;

fs::path write(const fs::path& folder, const std::string& text) {
  const fs::path file = folder / "graph.g2o";
  std::ofstream(file) << text;
  return file;
}

std::string fault_of(const fs::path& file) {
  try {
    (void)read_g2o(file);
  } catch (const DatasetError& error) {
    return error.what();
  }
  return "";
}

constexpr const char* unit_information = " 1 0 0 0 0 0 1 0 0 0 0 1 0 0 0 1 0 0 1 0 1\n";

TEST(G2oFile, WhatIsWrittenIsRead) {
  const ScratchFolder scratch;
  PoseGraph graph;
  for (int i = 0; i < 4; ++i) {
    PoseTangent xi;
    xi << 1.0 * i, 0.5, -2.0 * i, 0.1 * i, 0.2, -0.3;
    graph.T_map_node.push_back(motion_of(xi));
  }
  Matrix6d root = Matrix6d::Random();
  const Matrix6d information = root * root.transpose() + Matrix6d::Identity();
  for (std::size_t i = 0; i < 3; ++i)
    graph.edges.push_back({i, i + 1, motion_of(PoseTangent::Constant(0.1)), information, false});
  graph.edges.push_back({0, 3, motion_of(PoseTangent::Constant(0.2)), information, true});
  const fs::path file = scratch.path() / "written.g2o";
  write_g2o(file, graph);
  const PoseGraph read = read_g2o(file);
  ASSERT_EQ(read.T_map_node.size(), 4U);
  ASSERT_EQ(read.edges.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_TRUE(read.T_map_node[i].isApprox(graph.T_map_node[i], 1e-12));
    EXPECT_TRUE(read.edges[i].T_from_to.isApprox(graph.edges[i].T_from_to, 1e-12));
    EXPECT_TRUE(read.edges[i].information.isApprox(information, 1e-12));
    EXPECT_EQ(read.edges[i].is_loop, i == 3);
  }
}

TEST(G2oFile, IdsMayHaveGaps) {
  const ScratchFolder scratch;
  const PoseGraph graph =
      read_g2o(write(scratch.path(), std::string("VERTEX_SE3:QUAT 70 7 0 0 0 0 0 1\n# a remark\n") +
                                         "VERTEX_SE3:QUAT 5 1 2 3 0 0 0 1\nFIX 5\n" +
                                         "EDGE_SE3:QUAT 5 70 6 0 0 0 0 0 1" + unit_information));
  ASSERT_EQ(graph.T_map_node.size(), 2U);
  EXPECT_EQ(graph.T_map_node[0].translation(), Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(graph.edges.at(0).from, 0U);
  EXPECT_EQ(graph.edges.at(0).to, 1U);
}

TEST(G2oFile, FaultsNameTheLine) {
  const ScratchFolder scratch;
  const auto fault = [&](const std::string& text) { return fault_of(write(scratch.path(), text)); };
  EXPECT_THAT(fault("VERTEX_SE3:QUAT 0 1 2 3 0 0 0\n"), testing::HasSubstr("line 1: a number"));
  EXPECT_THAT(fault("VERTEX_SE3:QUAT 0 1 nan 3 0 0 0 1\n"), testing::HasSubstr("line 1"));
  EXPECT_THAT(fault("VERTEX_SE3:QUAT 0 1 2 3 0 0 0 0\n"), testing::HasSubstr("quaternion"));
  EXPECT_THAT(fault("\nVERTEX_SE2 0 1 2 3\n"), testing::HasSubstr("line 2: 'VERTEX_SE2'"));
  EXPECT_THAT(fault("EDGE_SE3:QUAT 0 x\n"), testing::HasSubstr("line 1"));
  const std::string node = "VERTEX_SE3:QUAT 0 1 2 3 0 0 0 1\n";
  EXPECT_THAT(fault(node + node), testing::HasSubstr("there already"));
  EXPECT_THAT(fault(""), testing::HasSubstr("no nodes"));
  EXPECT_THAT(fault_of(scratch.path() / "none.g2o"), testing::HasSubstr("cannot be opened"));
}

// SE-Sync's graphs, where STILLMAP_POSE_GRAPHS names their folder: within 0.1 % of the optimum that
// SE-Sync has certified (D. Rosen et al., IJRR 2019, table 1).
TEST(G2oFile, KnownGraphsAreSolvedToTheirCertifiedOptimum) {
  const char* const folder = std::getenv("STILLMAP_POSE_GRAPHS");
  if (folder == nullptr) GTEST_SKIP() << "STILLMAP_POSE_GRAPHS is not set";
  const std::map<std::string, double> optimum{
      {"sphere2500", 1687.0}, {"torus3D", 24227.0}, {"parking-garage", 1.263}, {"cubicle", 717.1}};
  for (const auto& [name, certified] : optimum) {
    PoseGraph graph = read_g2o(fs::path(folder) / (name + ".g2o"));
    graph.T_map_node = chordal_initialization(graph);
    const double cost = optimize(graph, {.error = EdgeError::chordal}).cost;
    RecordProperty(name, std::to_string(cost));
    EXPECT_NEAR(cost, certified, 0.001 * certified) << name;
  }
}

}  // namespace
}  // namespace stillmap
