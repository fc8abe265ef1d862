#pragma once

#include "core/segmentation/graph/network_graph.hpp"
#include "core/segmentation/onnx/onnx_weights.hpp"

namespace stillmap {

/// The operation of a node that works on one image: Conv, ConvTranspose, BatchNormalization,
/// LeakyRelu, Relu. Throws UnsupportedLayer naming any other operator, or GraphFault.
[[nodiscard]] Operation read_operation(const onnx::NodeProto& node, const OnnxWeights& weights);

}  // namespace stillmap
