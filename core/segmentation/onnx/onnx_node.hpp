#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/segmentation/graph/network_graph.hpp"

namespace onnx {
class AttributeProto;
class GraphProto;
class NodeProto;
class TensorProto;
}  // namespace onnx

namespace stillmap {

/// The attributes of a node of an ONNX graph; `default_value` is ONNX's, for an absent attribute.
/// Throws GraphFault for a value out of range.
class OnnxAttributes {
 public:
  explicit OnnxAttributes(const onnx::NodeProto& node) : node_(node) {}

  [[nodiscard]] float float_value(const std::string& name, float default_value) const;
  [[nodiscard]] std::int64_t int_value(const std::string& name, std::int64_t default_value) const;
  [[nodiscard]] std::string string_value(const std::string& name) const;
  /// Empty when the attribute is absent.
  [[nodiscard]] std::vector<std::int64_t> int_values(const std::string& name) const;

  /// Two numbers, each at least `min_value`.
  [[nodiscard]] RowsColumns pair(const std::string& name, int min_value,
                                 RowsColumns default_value) const;
  /// `pads`, all of them 0 or more.
  [[nodiscard]] Padding padding() const;

 private:
  [[nodiscard]] const onnx::AttributeProto* find(const std::string& name) const;
  [[noreturn]] void refuse(const std::string& name, const std::string& fault) const;
  [[nodiscard]] std::vector<int> bounded_ints(const std::string& name, int min_value,
                                              std::vector<int> default_value) const;

  const onnx::NodeProto& node_;
};

/// The name of a layer in messages and in Int8Calibration::float_layers: the node's, or the name of
/// its output when it has none.
[[nodiscard]] std::string layer_name(const onnx::NodeProto& node);

/// The weights of an ONNX graph by name. Input number `input` of a node must be weights: else
/// throws UnsupportedLayer, or GraphFault when there is no such input.
class OnnxWeights {
 public:
  explicit OnnxWeights(const onnx::GraphProto& graph);

  [[nodiscard]] bool has(const std::string& name) const { return tensors_.contains(name); }
  /// Adds an alias, or the weights of a Constant node.
  void add(const std::string& name, const onnx::TensorProto& tensor) { tensors_[name] = &tensor; }
  [[nodiscard]] const onnx::TensorProto& tensor(const std::string& name) const {
    return *tensors_.at(name);
  }

  [[nodiscard]] std::vector<float> values(const onnx::NodeProto& node, int input) const;
  /// Throws GraphFault when there are not `count` values.
  [[nodiscard]] std::vector<float> values(const onnx::NodeProto& node, int input,
                                          std::size_t count) const;
  /// Throws GraphFault when there are not `dimensions` dimensions.
  [[nodiscard]] std::vector<int> shape(const onnx::NodeProto& node, int input,
                                       int dimensions) const;
  [[nodiscard]] std::vector<std::int64_t> int_values(const onnx::NodeProto& node, int input) const;

 private:
  [[nodiscard]] const onnx::TensorProto& find(const onnx::NodeProto& node, int input) const;

  std::map<std::string, const onnx::TensorProto*> tensors_;
};

/// The operation of a node with one image as input: Conv, ConvTranspose, BatchNormalization,
/// LeakyRelu, Relu. Throws UnsupportedLayer for any other operator, or GraphFault.
[[nodiscard]] Operation read_operation(const onnx::NodeProto& node, const OnnxWeights& weights);

}  // namespace stillmap
