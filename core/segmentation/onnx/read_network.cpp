#include "core/segmentation/onnx/read_network.hpp"

#include <onnx/onnx_pb.h>

#include <map>

#include "core/segmentation/onnx/onnx_attributes.hpp"
#include "core/segmentation/onnx/onnx_check.hpp"
#include "core/segmentation/onnx/onnx_operations.hpp"
#include "core/segmentation/onnx/onnx_weights.hpp"
#include "core/segmentation/onnx/softmax_matcher.hpp"

namespace stillmap {
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
