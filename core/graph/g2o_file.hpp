#pragma once

#include <filesystem>

#include "core/graph/pose_graph.hpp"

namespace stillmap {

/// Reads a pose graph in g2o's text form: VERTEX_SE3:QUAT and EDGE_SE3:QUAT, with ids in any order;
/// the graph's nodes are in the order of their ids. Nodes that only edges name stand at the
/// identity. Edges between ids that do not follow one another are loops. FIX and comments are
/// skipped. Throws DatasetError naming the file and the line.
[[nodiscard]] PoseGraph read_g2o(const std::filesystem::path& file);

/// Writes the same form, ids from 0. Throws DatasetError.
void write_g2o(const std::filesystem::path& file, const PoseGraph& graph);

}  // namespace stillmap
