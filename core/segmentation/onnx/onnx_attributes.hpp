#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "core/segmentation/graph/network_graph.hpp"

namespace onnx {
class AttributeProto;
class NodeProto;
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

}  // namespace stillmap
