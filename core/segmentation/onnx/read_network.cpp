#include "core/segmentation/onnx/read_network.hpp"

#include <onnx/onnx_pb.h>

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/segmentation/onnx/onnx_file.hpp"
#include "core/segmentation/onnx/onnx_node.hpp"

namespace stillmap {
namespace {

using Order = std::vector<std::int64_t>;

constexpr std::int64_t channel_axis = 1;
/// From this operator set on Softmax works along one axis, before along all from its axis on.
constexpr std::int64_t one_axis_set = 13;

/// Both permutations with which exporters move the channels to the last axis.
bool channels_last(const Order& order) {
  return order == Order{0, 2, 3, 1} || order == Order{0, 3, 2, 1};
}
/// `back` is the inverse permutation of `order`.
bool is_inverse(const Order& back, const Order& order) {
  if (back.size() != order.size()) return false;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (back[i] < 0 || back[i] >= static_cast<std::int64_t>(order.size())) return false;
    if (order[static_cast<std::size_t>(back[i])] != static_cast<std::int64_t>(i)) return false;
  }
  return true;
}

/// Recognises a soft-max over the channels in the three forms that exporters write: Softmax; Exp,
/// ReduceSum, Div (PyTorch up to 1.4); Softmax between two Transposes (operator sets before 13,
/// whose Softmax works on the last axes only).
class SoftmaxMatcher {
 public:
  explicit SoftmaxMatcher(const onnx::ModelProto& model);

  /// std::nullopt when the node is no part of a soft-max. Else the name of the tensor whose
  /// soft-max it completes, or an empty string when more parts must follow.
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

  /// The part that makes input number `input`, if it is in this stage; else null.
  [[nodiscard]] const Part* part(const onnx::NodeProto& node, int input, Stage stage) const;
  std::optional<std::string> keep(const onnx::NodeProto& node, Part part);

  std::int64_t operator_set_ = 0;
  std::map<std::string, Part> parts_;
};

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
      OnnxAttributes(node).int_value("axis", operator_set_ >= one_axis_set ? -1 : 1);
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
      node.input_size() > 1 ? weights.int_values(node, 1) : attributes.int_values("axes");
  const bool over_channels =
      axes == Order{channel_axis} && attributes.int_value("keepdims", 1) == 1;
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
  const Order order = OnnxAttributes(node).int_values("perm");
  if (const Part* const before = part(node, 0, Stage::normalised)) {
    if (is_inverse(order, before->order)) return before->scores;
    return std::nullopt;
  }
  if (!channels_last(order)) return std::nullopt;
  return keep(node, {Stage::transposed, node.input(0), order});
}

/// Builds a NetworkGraph from the nodes of an ONNX graph, in their order.
class GraphReader {
 public:
  explicit GraphReader(const onnx::ModelProto& model)
      : proto_(model.graph()), weights_(model.graph()), softmax_(model) {
    graph_.input = add_tensor(network_input(proto_)->name());
  }

  NetworkGraph read() {
    for (const onnx::NodeProto& node : proto_.node()) read_node(node);
    graph_.output = tensor(proto_.output(0).name());
    return std::move(graph_);
  }

 private:
  void read_node(const onnx::NodeProto& node) {
    const std::string& kind = node.op_type();
    if (kind == "Constant") {
      read_constant(node);
    } else if (kind == "Identity" || kind == "Dropout") {
      read_alias(node);
    } else if (const std::optional<std::string> scores = softmax_.match(node, weights_)) {
      // The node that completes a soft-max becomes the layer.
      if (!scores->empty()) add_layer(node, Softmax{}, {tensor(*scores)});
    } else if (kind == "Add") {
      add_layer(node, Add{}, {tensor(input_name(node, 0)), tensor(input_name(node, 1))});
    } else {
      add_layer(node, read_operation(node, weights_), {tensor(input_name(node, 0))});
    }
  }

  void read_constant(const onnx::NodeProto& node) {
    for (const onnx::AttributeProto& attribute : node.attribute()) {
      if (attribute.name() == "value" && node.output_size() == 1) {
        weights_.add(node.output(0), attribute.t());
      }
    }
  }

  /// A node without effect at inference: its output is another name for its input.
  void read_alias(const onnx::NodeProto& node) {
    const std::string& from = input_name(node, 0);
    const std::string& to = node.output(0);
    if (weights_.has(from)) {
      weights_.add(to, weights_.tensor(from));
    } else {
      tensors_[to] = tensor(from);
    }
  }

  void add_layer(const onnx::NodeProto& node, Operation operation, std::vector<TensorId> inputs) {
    if (node.output().empty()) throw GraphFault("layer '" + layer_name(node) + "' has no output");
    graph_.layers.push_back({.name = layer_name(node),
                             .operation = std::move(operation),
                             .inputs = std::move(inputs),
                             .output = add_tensor(node.output(0))});
  }

  TensorId add_tensor(const std::string& name) {
    graph_.tensors.push_back({.name = name});
    return tensors_[name] = graph_.tensors.size() - 1;
  }

  static const std::string& input_name(const onnx::NodeProto& node, int input) {
    if (input < node.input_size() && !node.output().empty()) return node.input(input);
    throw GraphFault("layer '" + layer_name(node) + "' has too few inputs or no output");
  }

  TensorId tensor(const std::string& name) const {
    const auto found = tensors_.find(name);
    if (found != tensors_.end()) return found->second;
    throw UnsupportedLayer("'" + name + "' is used as an image, but is weights or a part of a " +
                           "computation that is not supported");
  }

  const onnx::GraphProto& proto_;
  OnnxWeights weights_;
  SoftmaxMatcher softmax_;
  std::map<std::string, TensorId> tensors_;
  NetworkGraph graph_;
};

}  // namespace

NetworkGraph read_network(const OnnxFile& file) { return GraphReader(file.model()).read(); }

}  // namespace stillmap
