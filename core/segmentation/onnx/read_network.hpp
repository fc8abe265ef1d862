#pragma once

#include "core/segmentation/graph/network_graph.hpp"
#include "core/segmentation/onnx/onnx_file.hpp"

namespace stillmap {

/// The network of an ONNX file as a graph, without shapes. A soft-max that was exported in parts
/// (Exp, ReduceSum, Div, or between two Transposes) becomes one layer.
///
/// Throws UnsupportedLayer for an operator that is not supported, or GraphFault.
[[nodiscard]] NetworkGraph read_network(const OnnxFile& file);

}  // namespace stillmap
