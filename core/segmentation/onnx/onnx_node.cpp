#include "core/segmentation/onnx/onnx_node.hpp"

#include <onnx/onnx_pb.h>

#include <algorithm>
#include <cmath>

#include "core/segmentation/onnx/onnx_file.hpp"

namespace stillmap {
namespace {

/// Upper bound of kernel sizes, strides and paddings.
constexpr std::int64_t max_number = 4096;

}  // namespace

std::string layer_name(const onnx::NodeProto& node) {
  if (!node.name().empty()) return node.name();
  return node.output().empty() ? node.op_type() : node.output(0);
}

const onnx::AttributeProto* OnnxAttributes::find(const std::string& name) const {
  const auto found = std::ranges::find_if(
      node_.attribute(), [&name](const auto& attribute) { return attribute.name() == name; });
  return found == node_.attribute().end() ? nullptr : &*found;
}

void OnnxAttributes::refuse(const std::string& name, const std::string& fault) const {
  throw GraphFault("layer '" + layer_name(node_) + "': " + name + " " + fault);
}

float OnnxAttributes::float_value(const std::string& name, float default_value) const {
  const onnx::AttributeProto* const attribute = find(name);
  return attribute == nullptr ? default_value : attribute->f();
}

std::int64_t OnnxAttributes::int_value(const std::string& name, std::int64_t default_value) const {
  const onnx::AttributeProto* const attribute = find(name);
  return attribute == nullptr ? default_value : attribute->i();
}

std::string OnnxAttributes::string_value(const std::string& name) const {
  const onnx::AttributeProto* const attribute = find(name);
  return attribute == nullptr ? std::string() : attribute->s();
}

std::vector<std::int64_t> OnnxAttributes::int_values(const std::string& name) const {
  const onnx::AttributeProto* const attribute = find(name);
  if (attribute == nullptr) return {};
  return {attribute->ints().begin(), attribute->ints().end()};
}

std::vector<int> OnnxAttributes::bounded_ints(const std::string& name, int min_value,
                                              std::vector<int> default_value) const {
  const std::vector<std::int64_t> written = int_values(name);
  if (written.empty()) return default_value;
  if (written.size() != default_value.size()) {
    refuse(name, "has " + std::to_string(written.size()) + " numbers where " +
                     std::to_string(default_value.size()) + " are wanted: not an image?");
  }
  for (std::size_t i = 0; i < written.size(); ++i) {
    if (written[i] < min_value || written[i] > max_number) {
      refuse(name, "is " + std::to_string(written[i]) + ", but must be " +
                       std::to_string(min_value) + ".." + std::to_string(max_number));
    }
    default_value[i] = static_cast<int>(written[i]);
  }
  return default_value;
}

RowsColumns OnnxAttributes::pair(const std::string& name, int min_value,
                                 RowsColumns default_value) const {
  const std::vector<int> pair =
      bounded_ints(name, min_value, {default_value.rows, default_value.columns});
  return {.rows = pair[0], .columns = pair[1]};
}

Padding OnnxAttributes::padding() const {
  if (const std::string how = string_value("auto_pad"); !how.empty() && how != "NOTSET") {
    throw UnsupportedLayer("layer '" + layer_name(node_) + "': auto_pad " + how +
                           " is not supported");
  }
  const std::vector<int> pads = bounded_ints("pads", 0, {0, 0, 0, 0});
  return {.top = pads[0], .left = pads[1], .bottom = pads[2], .right = pads[3]};
}

namespace {

[[noreturn]] void refuse(const onnx::NodeProto& node, const std::string& fault) {
  throw GraphFault("layer '" + layer_name(node) + "': " + fault);
}

}  // namespace

OnnxWeights::OnnxWeights(const onnx::GraphProto& graph) {
  for (const onnx::TensorProto& tensor : graph.initializer()) add(tensor.name(), tensor);
}

const onnx::TensorProto& OnnxWeights::find(const onnx::NodeProto& node, int input) const {
  if (input >= node.input_size()) refuse(node, "has too few inputs");
  const auto found = tensors_.find(node.input(input));
  if (found != tensors_.end()) return *found->second;
  throw UnsupportedLayer("layer '" + layer_name(node) + "': '" + node.input(input) +
                         "' is worked out by the network, where weights from the file are wanted");
}

std::vector<float> OnnxWeights::values(const onnx::NodeProto& node, int input) const {
  const onnx::TensorProto& tensor = find(node, input);
  if (tensor.data_type() != onnx::TensorProto::FLOAT) {
    throw UnsupportedLayer("layer '" + layer_name(node) + "': weights '" + tensor.name() +
                           "' are not 32-bit floating point numbers");
  }
  return tensor_floats(tensor);
}

std::vector<float> OnnxWeights::values(const onnx::NodeProto& node, int input,
                                       std::size_t count) const {
  std::vector<float> found = values(node, input);
  if (found.size() != count) {
    refuse(node, "'" + node.input(input) + "' has " + std::to_string(found.size()) +
                     " values where " + std::to_string(count) + " are wanted");
  }
  return found;
}

std::vector<int> OnnxWeights::shape(const onnx::NodeProto& node, int input, int dimensions) const {
  const onnx::TensorProto& tensor = find(node, input);
  if (tensor.dims_size() != dimensions) {
    refuse(node, "weights '" + tensor.name() + "' have " + std::to_string(tensor.dims_size()) +
                     " dimensions where " + std::to_string(dimensions) + " are wanted");
  }
  constexpr std::int64_t max_size = 65536;
  std::vector<int> shape;
  for (const std::int64_t size : tensor.dims()) {
    if (size < 1 || size > max_size) {
      refuse(node, "weights '" + tensor.name() + "' have a dimension of " + std::to_string(size));
    }
    shape.push_back(static_cast<int>(size));
  }
  return shape;
}

std::vector<std::int64_t> OnnxWeights::int_values(const onnx::NodeProto& node, int input) const {
  return tensor_ints(find(node, input));
}

namespace {

void require_one_group(const onnx::NodeProto& node) {
  const std::int64_t group = OnnxAttributes(node).int_value("group", 1);
  if (group == 1) return;
  throw UnsupportedLayer("layer '" + layer_name(node) + "': " + node.op_type() + " in " +
                         std::to_string(group) + " groups is not supported");
}

/// The kernel's size by its weights. Throws GraphFault when the attribute differs.
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
                     .upsampling = {}};
}

Operation read_transposed(const onnx::NodeProto& node, const OnnxWeights& weights) {
  require_one_group(node);
  const OnnxAttributes attributes(node);
  if (attributes.pair("dilations", 1, {}) != RowsColumns{} ||
      !attributes.int_values("output_shape").empty()) {
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
  const float epsilon = OnnxAttributes(node).float_value("epsilon", 1e-5F);
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
  if (kind == "LeakyRelu") return LeakyRelu{OnnxAttributes(node).float_value("alpha", 0.01F)};
  if (kind == "Relu") return LeakyRelu{0.0F};
  throw UnsupportedLayer("operator " + kind + " (layer '" + layer_name(node) +
                         "') is not supported");
}

}  // namespace stillmap
