#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/segmentation/onnx/onnx_weights.hpp"

namespace onnx {
class ModelProto;
}  // namespace onnx

namespace stillmap {

/// Puts soft-maxes over the channels together that exporters write in one of three ways: as
/// Softmax; as Exp, ReduceSum, Div (PyTorch up to 1.4); between two Transposes (before operator set
/// 13, whose Softmax knows only the last axis).
class SoftmaxMatcher {
 public:
  explicit SoftmaxMatcher(const onnx::ModelProto& model);

  /// Nothing when the node is no part of a soft-max. Else empty, or for the part that ends it the
  /// name of the tensor whose soft-max it makes.
  std::optional<std::string> match(const onnx::NodeProto& node, const OnnxWeights& weights);

 private:
  enum class Stage { exponential, sum, transposed, normalised };
  struct Part {
    Stage stage;
    std::string scores;
    /// Of a Transpose.
    std::vector<std::int64_t> order = {};
  };

  std::optional<std::string> match_softmax(const onnx::NodeProto& node);
  std::optional<std::string> match_exponential(const onnx::NodeProto& node);
  std::optional<std::string> match_sum(const onnx::NodeProto& node, const OnnxWeights& weights);
  std::optional<std::string> match_division(const onnx::NodeProto& node);
  std::optional<std::string> match_transpose(const onnx::NodeProto& node);

  /// What input number `input` is, when that is a part in this stage.
  [[nodiscard]] const Part* part(const onnx::NodeProto& node, int input, Stage stage) const;
  std::optional<std::string> keep(const onnx::NodeProto& node, Part part);

  std::int64_t operator_set_ = 0;
  std::map<std::string, Part> parts_;
};

}  // namespace stillmap
