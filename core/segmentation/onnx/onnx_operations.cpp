#include "core/segmentation/onnx/onnx_operations.hpp"

#include <onnx/onnx_pb.h>

#include <cmath>

#include "core/segmentation/onnx/onnx_attributes.hpp"

namespace stillmap {
namespace {

void require_one_group(const onnx::NodeProto& node) {
  const std::int64_t group = OnnxAttributes(node).whole("group", 1);
  if (group == 1) return;
  throw UnsupportedLayer("layer '" + layer_name(node) + "': " + node.op_type() + " in " +
                         std::to_string(group) + " groups is not supported");
}

/// The kernel's size as the weights have it; the attribute, where it is, must say the same.
RowsColumns kernel(const onnx::NodeProto& node, const std::vector<int>& weights_shape) {
  const RowsColumns of_weights{.rows = weights_shape[2], .columns = weights_shape[3]};
  if (OnnxAttributes(node).pair("kernel_shape", 1, of_weights) == of_weights) return of_weights;
  throw GraphFault("layer '" + layer_name(node) + "': kernel_shape is not that of its weights");
}

std::vector<float> bias(const onnx::NodeProto& node, const OnnxWeights& weights, int outputs) {
  const auto count = static_cast<std::size_t>(outputs);
  const bool has_bias = node.input_size() > 2 && !node.input(2).empty();
  return has_bias ? weights.values(node, 2, count) : std::vector<float>(count, 0.0F);
}

Operation read_convolution(const onnx::NodeProto& node, const OnnxWeights& weights) {
  require_one_group(node);
  const OnnxAttributes attributes(node);
  const std::vector<int> shape = weights.shape(node, 1, 4);
  return Convolution{.outputs = shape[0],
                     .inputs = shape[1],
                     .kernel = kernel(node, shape),
                     .stride = attributes.pair("strides", 1, {}),
                     .dilation = attributes.pair("dilations", 1, {}),
                     .padding = attributes.padding(),
                     .weights = weights.values(node, 1),
                     .bias = bias(node, weights, shape[0]),
                     .widen = {}};
}

Operation read_transposed(const onnx::NodeProto& node, const OnnxWeights& weights) {
  require_one_group(node);
  const OnnxAttributes attributes(node);
  if (attributes.pair("dilations", 1, {}) != RowsColumns{} ||
      !attributes.whole_numbers("output_shape").empty()) {
    throw UnsupportedLayer("layer '" + layer_name(node) +
                           "': ConvTranspose with dilations or output_shape is not supported");
  }
  const std::vector<int> shape = weights.shape(node, 1, 4);
  return TransposedConvolution{
      .inputs = shape[0],
      .outputs = shape[1],
      .kernel = kernel(node, shape),
      .stride = attributes.pair("strides", 1, {}),
      .padding = attributes.padding(),
      .extra = attributes.pair("output_padding", 0, {.rows = 0, .columns = 0}),
      .weights = weights.values(node, 1),
      .bias = bias(node, weights, shape[1])};
}

Operation read_batch_norm(const onnx::NodeProto& node, const OnnxWeights& weights) {
  const std::vector<float> gamma = weights.values(node, 1);
  const std::vector<float> beta = weights.values(node, 2, gamma.size());
  const std::vector<float> mean = weights.values(node, 3, gamma.size());
  const std::vector<float> variance = weights.values(node, 4, gamma.size());
  const float epsilon = OnnxAttributes(node).real("epsilon", 1e-5F);
  BatchNorm norm;
  for (std::size_t c = 0; c < gamma.size(); ++c) {
    norm.scale.push_back(gamma[c] / std::sqrt(variance[c] + epsilon));
    norm.offset.push_back(beta[c] - norm.scale[c] * mean[c]);
    if (!std::isfinite(norm.scale[c]) || !std::isfinite(norm.offset[c])) {
      throw GraphFault("layer '" + layer_name(node) + "': its variance is negative or 0");
    }
  }
  return norm;
}

}  // namespace

Operation read_operation(const onnx::NodeProto& node, const OnnxWeights& weights) {
  const std::string& kind = node.op_type();
  if (kind == "Conv") return read_convolution(node, weights);
  if (kind == "ConvTranspose") return read_transposed(node, weights);
  if (kind == "BatchNormalization") return read_batch_norm(node, weights);
  if (kind == "LeakyRelu") return LeakyRelu{OnnxAttributes(node).real("alpha", 0.01F)};
  if (kind == "Relu") return LeakyRelu{0.0F};
  throw UnsupportedLayer("operator " + kind + " (layer '" + layer_name(node) +
                         "') is not supported");
}

}  // namespace stillmap
