#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/segmentation/graph/network_graph.hpp"

namespace onnx {
class AttributeProto;
class NodeProto;
}  // namespace onnx
namespace onnx {
class GraphProto;
class NodeProto;
class TensorProto;
}  // namespace onnx

namespace stillmap {

/// The attributes of a layer in an ONNX file, each with what ONNX says of its absence. All throw
/// GraphFault for values that make no sense.
class OnnxAttributes {
 public:
  explicit OnnxAttributes(const onnx::NodeProto& node) : node_(node) {}

  [[nodiscard]] float real(const std::string& name, float default_value) const;
  [[nodiscard]] std::int64_t whole(const std::string& name, std::int64_t default_value) const;
  [[nodiscard]] std::string text(const std::string& name) const;
  /// Empty when it is absent.
  [[nodiscard]] std::vector<std::int64_t> whole_numbers(const std::string& name) const;

  /// A pair of rows and columns, each `min_value` or more.
  [[nodiscard]] RowsColumns pair(const std::string& name, int min_value,
                                 RowsColumns default_value) const;
  /// `pads`, none of them negative.
  [[nodiscard]] Padding padding() const;

 private:
  [[nodiscard]] const onnx::AttributeProto* find(const std::string& name) const;
  [[noreturn]] void refuse(const std::string& name, const std::string& fault) const;
  [[nodiscard]] std::vector<int> small_numbers(const std::string& name, int min_value,
                                               std::vector<int> default_value) const;

  const onnx::NodeProto& node_;
};

/// The name of a layer for messages and settings: its own, or else its output's.
[[nodiscard]] std::string layer_name(const onnx::NodeProto& node);

/// The weights of an ONNX network by name.
class OnnxWeights {
 public:
  explicit OnnxWeights(const onnx::GraphProto& graph);

  [[nodiscard]] bool has(const std::string& name) const { return tensors_.contains(name); }
  /// Another name for the same weights, or weights that a Constant layer holds.
  void add(const std::string& name, const onnx::TensorProto& tensor) { tensors_[name] = &tensor; }
  [[nodiscard]] const onnx::TensorProto& tensor(const std::string& name) const {
    return *tensors_.at(name);
  }

  /// Input number `input` of `node`, which must be weights of `dimensions` dimensions. Throws
  /// GraphFault.
  [[nodiscard]] std::vector<float> values(const onnx::NodeProto& node, int input) const;
  [[nodiscard]] std::vector<int> shape(const onnx::NodeProto& node, int input,
                                       int dimensions) const;
  /// The same, of which there must be `count`.
  [[nodiscard]] std::vector<float> values(const onnx::NodeProto& node, int input,
                                          std::size_t count) const;
  [[nodiscard]] std::vector<std::int64_t> whole_numbers(const onnx::NodeProto& node,
                                                        int input) const;

 private:
  [[nodiscard]] const onnx::TensorProto& find(const onnx::NodeProto& node, int input) const;

  std::map<std::string, const onnx::TensorProto*> tensors_;
};

/// The operation of a node that works on one image: Conv, ConvTranspose, BatchNormalization,
/// LeakyRelu, Relu. Throws UnsupportedLayer naming any other operator, or GraphFault.
[[nodiscard]] Operation read_operation(const onnx::NodeProto& node, const OnnxWeights& weights);

}  // namespace stillmap
