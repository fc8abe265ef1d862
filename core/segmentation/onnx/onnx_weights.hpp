#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "core/segmentation/graph/network_graph.hpp"

namespace onnx {
class GraphProto;
class NodeProto;
class TensorProto;
}  // namespace onnx

namespace stillmap {

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

}  // namespace stillmap
