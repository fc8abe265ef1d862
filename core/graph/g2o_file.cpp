#include "core/graph/g2o_file.hpp"

#include <cmath>
#include <fstream>
#include <iomanip>
#include <map>
#include <sstream>
#include <string>

#include "core/dataset/dataset_error.hpp"

namespace stillmap {
namespace {

using NodeId = long long;

/// A line of the file, with its place for faults.
class Line {
 public:
  Line(const std::filesystem::path& file, std::size_t number, const std::string& text)
      : file_(file), number_(number), words_(text) {
    words_ >> tag_;
  }

  [[nodiscard]] const std::string& tag() const { return tag_; }
  [[noreturn]] void fail(const std::string& fault) const {
    throw DatasetError(file_, "line " + std::to_string(number_) + ": " + fault);
  }
  NodeId id() {
    NodeId value = 0;
    if (!(words_ >> value)) fail("the number of a node is missing or no whole number");
    return value;
  }
  double number() {
    double value = 0.0;
    if (!(words_ >> value) || !std::isfinite(value))
      fail("a number is missing, not finite or no number");
    return value;
  }
  /// x y z qx qy qz qw.
  Eigen::Isometry3d pose() {
    Eigen::Vector3d t;
    for (int k = 0; k < 3; ++k) t[k] = number();
    Eigen::Quaterniond q;
    for (int k = 0; k < 4; ++k) q.coeffs()[k] = number();
    if (!(q.norm() > 0.5 && q.norm() < 2.0)) fail("the quaternion is not of unit length");
    return Eigen::Translation3d(t) * q.normalized();
  }
  /// The upper triangle, row by row.
  Matrix6d information() {
    Matrix6d matrix;
    for (int i = 0; i < 6; ++i)
      for (int k = i; k < 6; ++k) matrix(i, k) = matrix(k, i) = number();
    return matrix;
  }

 private:
  const std::filesystem::path& file_;
  std::size_t number_;
  std::istringstream words_;
  std::string tag_;
};

struct EdgeOfIds {
  NodeId from, to;
  PoseEdge edge;
};

/// What the lines say, before nodes are numbered.
struct G2oContent {
  std::map<NodeId, Eigen::Isometry3d> nodes;
  std::vector<EdgeOfIds> edges;

  void take(Line line) {
    if (line.tag() == "VERTEX_SE3:QUAT") {
      const NodeId id = line.id();
      if (!nodes.emplace(id, line.pose()).second)
        line.fail("node " + std::to_string(id) + " is there already");
    } else if (line.tag() == "EDGE_SE3:QUAT") {
      EdgeOfIds edge{.from = line.id(), .to = line.id(), .edge = {}};
      edge.edge.T_from_to = line.pose();
      edge.edge.information = line.information();
      edges.push_back(edge);
    } else if (!line.tag().empty() && line.tag() != "FIX" && line.tag()[0] != '#') {
      line.fail("'" + line.tag() +
                "' is neither VERTEX_SE3:QUAT nor EDGE_SE3:QUAT: only graphs of poses in space "
                "are read");
    }
  }
};

PoseGraph numbered(G2oContent content) {
  for (const EdgeOfIds& edge : content.edges) {
    content.nodes.try_emplace(edge.from, Eigen::Isometry3d::Identity());
    content.nodes.try_emplace(edge.to, Eigen::Isometry3d::Identity());
  }
  PoseGraph graph;
  std::map<NodeId, std::size_t> number;
  for (const auto& [id, pose] : content.nodes) {
    number.emplace(id, graph.T_map_node.size());
    graph.T_map_node.push_back(pose);
  }
  for (EdgeOfIds& edge : content.edges) {
    edge.edge.from = number.at(edge.from);
    edge.edge.to = number.at(edge.to);
    edge.edge.is_loop = edge.edge.to != edge.edge.from + 1;
    graph.edges.push_back(edge.edge);
  }
  return graph;
}

void write_pose(std::ostream& out, const Eigen::Isometry3d& T) {
  const Eigen::Quaterniond q(T.linear());
  for (const double value : T.translation()) out << ' ' << value;
  for (const double value : q.coeffs()) out << ' ' << value;
}

}  // namespace

PoseGraph read_g2o(const std::filesystem::path& file) {
  std::ifstream in(file);
  if (!in) throw DatasetError(file, "cannot be opened; check the path");
  G2oContent content;
  std::string text;
  for (std::size_t number = 1; std::getline(in, text); ++number)
    content.take(Line(file, number, text));
  PoseGraph graph = numbered(std::move(content));
  if (const std::string faults = graph.faults(EdgeError::chordal); !faults.empty())
    throw DatasetError(file, faults);
  return graph;
}

void write_g2o(const std::filesystem::path& file, const PoseGraph& graph) {
  std::ofstream out(file, std::ios::trunc);
  out << std::setprecision(17);
  for (std::size_t i = 0; i < graph.T_map_node.size(); ++i) {
    out << "VERTEX_SE3:QUAT " << i;
    write_pose(out, graph.T_map_node[i]);
    out << '\n';
  }
  for (const PoseEdge& edge : graph.edges) {
    out << "EDGE_SE3:QUAT " << edge.from << ' ' << edge.to;
    write_pose(out, edge.T_from_to);
    for (int i = 0; i < 6; ++i)
      for (int k = i; k < 6; ++k) out << ' ' << edge.information(i, k);
    out << '\n';
  }
  out.close();
  if (!out) throw DatasetWriteError(file, "cannot be written; check the folder and the space left");
}

}  // namespace stillmap
