#include "core/segmentation/onnx/read_network.hpp"

#include <onnx/onnx_pb.h>

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/segmentation/onnx/onnx_file.hpp"
#include "core/segmentation/onnx/onnx_node.hpp"

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

namespace {

/// Takes the nodes of an ONNX graph one by one.
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
      read_renaming(node);
    } else if (const std::optional<std::string> scores = softmax_.match(node, weights_)) {
      // The last part of a soft-max makes the layer, the others nothing.
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

  /// Layers that do nothing when a network is run.
  void read_renaming(const onnx::NodeProto& node) {
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
