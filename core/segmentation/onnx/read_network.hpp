#pragma once

#include "core/segmentation/graph/network_graph.hpp"
#include "core/segmentation/onnx/onnx_file.hpp"

namespace stillmap {

/// The network of an ONNX file as a graph; shapes are not known yet. Soft-maxes that were exported
/// in parts (Exp, ReduceSum, Div; or between two Transposes) are put together again.
///
/// Throws UnsupportedLayer naming the operator, or GraphFault.
[[nodiscard]] NetworkGraph read_network(const OnnxFile& file);

}  // namespace stillmap
