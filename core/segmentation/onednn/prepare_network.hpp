#pragma once

#include "core/segmentation/graph/network_graph.hpp"
#include "core/segmentation/model_description.hpp"
#include "core/segmentation/onnx/onnx_file.hpp"

namespace stillmap {

/// A network made ready for planning.
struct PreparedNetwork {
  NetworkGraph graph;
  /// The file ends in a soft-max, which was taken off: the output is its logits.
  bool had_softmax = false;
  /// Multiplications and additions of a run, in 10^9, as the file has its layers.
  double giga_operations = 0.0;
};

/// Reads a network for images of the description's size, and reduces it to convolutions with
/// follow-ups. Throws UnsupportedLayer or GraphFault.
[[nodiscard]] PreparedNetwork prepare_network(const OnnxFile& file, const ModelDescription& model);

}  // namespace stillmap
