#include "core/segmentation/onnx/onnx_weights.hpp"

#include <onnx/onnx_pb.h>

#include "core/segmentation/onnx/onnx_attributes.hpp"
#include "core/segmentation/onnx/onnx_tensor.hpp"

namespace stillmap {
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
  return float_values(tensor);
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

std::vector<std::int64_t> OnnxWeights::whole_numbers(const onnx::NodeProto& node, int input) const {
  return int_values(find(node, input));
}

}  // namespace stillmap
