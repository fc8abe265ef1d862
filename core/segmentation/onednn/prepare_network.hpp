#pragma once

#include "core/segmentation/graph/network_graph.hpp"
#include "core/segmentation/model_description.hpp"
#include "core/segmentation/onnx/onnx_file.hpp"

namespace stillmap {

/// A network after all passes, for plan_execution().
struct PreparedNetwork {
  NetworkGraph graph;
  /// The file ends in a soft-max, which was removed: the output is logits.
  bool had_softmax = false;
  /// Multiplications and additions per run, in 10^9, of the layers as they are in the file.
  double giga_operations = 0.0;
  /// Names of the layers as they are in the file.
  std::vector<std::string> file_layers = {};
};

/// Reads a network for images of the description's size, and reduces it to convolutions with
/// post-ops. Throws UnsupportedLayer or GraphFault.
[[nodiscard]] PreparedNetwork prepare_network(const OnnxFile& file, const ModelDescription& model);

}  // namespace stillmap
