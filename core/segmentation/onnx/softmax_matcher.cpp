#include "core/segmentation/onnx/softmax_matcher.hpp"

#include <onnx/onnx_pb.h>

#include "core/segmentation/onnx/onnx_attributes.hpp"

namespace stillmap {
namespace {

using Order = std::vector<std::int64_t>;

constexpr std::int64_t channel_axis = 1;
/// The Softmax of this set works along one axis; before, along all from its axis on.
constexpr std::int64_t one_axis_set = 13;

/// Both ways in which exporters bring the channels to the end, and how they put them back.
bool channels_last(const Order& order) {
  return order == Order{0, 2, 3, 1} || order == Order{0, 3, 2, 1};
}
bool undoes(const Order& back, const Order& order) {
  if (back.size() != order.size()) return false;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (back[i] < 0 || back[i] >= static_cast<std::int64_t>(order.size())) return false;
    if (order[static_cast<std::size_t>(back[i])] != static_cast<std::int64_t>(i)) return false;
  }
  return true;
}

}  // namespace

SoftmaxMatcher::SoftmaxMatcher(const onnx::ModelProto& model) {
  for (const onnx::OperatorSetIdProto& set : model.opset_import()) {
    if (set.domain().empty() || set.domain() == "ai.onnx") operator_set_ = set.version();
  }
}

std::optional<std::string> SoftmaxMatcher::match(const onnx::NodeProto& node,
                                                 const OnnxWeights& weights) {
  if (node.input().empty() || node.output().empty()) return std::nullopt;
  const std::string& kind = node.op_type();
  if (kind == "Softmax") return match_softmax(node);
  if (kind == "Exp") return match_exponential(node);
  if (kind == "ReduceSum") return match_sum(node, weights);
  if (kind == "Div") return match_division(node);
  if (kind == "Transpose") return match_transpose(node);
  return std::nullopt;
}

const SoftmaxMatcher::Part* SoftmaxMatcher::part(const onnx::NodeProto& node, int input,
                                                 Stage stage) const {
  if (input >= node.input_size()) return nullptr;
  const auto found = parts_.find(node.input(input));
  return found == parts_.end() || found->second.stage != stage ? nullptr : &found->second;
}

std::optional<std::string> SoftmaxMatcher::keep(const onnx::NodeProto& node, Part part) {
  parts_.insert_or_assign(node.output(0), std::move(part));
  return std::string();
}

std::optional<std::string> SoftmaxMatcher::match_softmax(const onnx::NodeProto& node) {
  const std::int64_t axis =
      OnnxAttributes(node).whole("axis", operator_set_ >= one_axis_set ? -1 : 1);
  if (const Part* const before = part(node, 0, Stage::transposed)) {
    if (axis != -1 && axis != 3) return std::nullopt;
    return keep(node, {Stage::normalised, before->scores, before->order});
  }
  const bool over_channels = axis == channel_axis || axis == -3;
  if (over_channels && operator_set_ >= one_axis_set) return node.input(0);
  return std::nullopt;
}

std::optional<std::string> SoftmaxMatcher::match_exponential(const onnx::NodeProto& node) {
  return keep(node, {Stage::exponential, node.input(0)});
}

std::optional<std::string> SoftmaxMatcher::match_sum(const onnx::NodeProto& node,
                                                     const OnnxWeights& weights) {
  const Part* const before = part(node, 0, Stage::exponential);
  const OnnxAttributes attributes(node);
  const Order axes =
      node.input_size() > 1 ? weights.whole_numbers(node, 1) : attributes.whole_numbers("axes");
  const bool over_channels = axes == Order{channel_axis} && attributes.whole("keepdims", 1) == 1;
  if (before == nullptr || !over_channels) return std::nullopt;
  return keep(node, {Stage::sum, before->scores});
}

std::optional<std::string> SoftmaxMatcher::match_division(const onnx::NodeProto& node) {
  const Part* const exponential = part(node, 0, Stage::exponential);
  const Part* const sum = part(node, 1, Stage::sum);
  if (exponential == nullptr || sum == nullptr) return std::nullopt;
  if (exponential->scores != sum->scores) return std::nullopt;
  return sum->scores;
}

std::optional<std::string> SoftmaxMatcher::match_transpose(const onnx::NodeProto& node) {
  const Order order = OnnxAttributes(node).whole_numbers("perm");
  if (const Part* const before = part(node, 0, Stage::normalised)) {
    if (undoes(order, before->order)) return before->scores;
    return std::nullopt;
  }
  if (!channels_last(order)) return std::nullopt;
  return keep(node, {Stage::transposed, node.input(0), order});
}

}  // namespace stillmap
