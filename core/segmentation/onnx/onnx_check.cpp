#include "core/segmentation/onnx/onnx_check.hpp"

#include <onnx/onnx_pb.h>

#include <algorithm>
#include <set>

#include "core/segmentation/onnx/onnx_tensor.hpp"

namespace stillmap {
namespace {

using Names = std::set<std::string>;

bool is_weight(const onnx::GraphProto& graph, const std::string& name) {
  return std::ranges::any_of(graph.initializer(), [&name](const onnx::TensorProto& tensor) {
    return tensor.name() == name;
  });
}

std::string weights_fault(const onnx::GraphProto& graph) {
  Names names;
  for (const onnx::TensorProto& tensor : graph.initializer()) {
    if (std::string fault = tensor_fault(tensor); !fault.empty()) return fault;
    if (!names.insert(tensor.name()).second) {
      return "weights '" + tensor.name() + "' stand in the file twice";
    }
  }
  return {};
}

std::string attribute_fault(const onnx::NodeProto& node) {
  for (const onnx::AttributeProto& attribute : node.attribute()) {
    if (attribute.has_t()) {
      if (std::string fault = tensor_fault(attribute.t()); !fault.empty()) return fault;
    }
  }
  return {};
}

std::string node_text(const onnx::NodeProto& node) {
  return node.op_type() + " '" + (node.name().empty() ? "without a name" : node.name()) + "'";
}

/// What is wrong with a node, given all that is known before it; adds what the node makes.
std::string node_fault(const onnx::NodeProto& node, Names& known) {
  for (const std::string& input : node.input()) {
    if (!input.empty() && !known.contains(input)) {
      return node_text(node) + " reads '" + input +
             "', which is neither a weight in the file nor made before it (missing, or a cycle)";
    }
  }
  for (const std::string& output : node.output()) {
    if (!output.empty() && !known.insert(output).second) {
      return node_text(node) + " makes '" + output + "', which is there already";
    }
  }
  return attribute_fault(node);
}

std::string nodes_fault(const onnx::GraphProto& graph) {
  Names known;
  for (const onnx::ValueInfoProto& input : graph.input()) known.insert(input.name());
  for (const onnx::TensorProto& tensor : graph.initializer()) known.insert(tensor.name());
  for (const onnx::NodeProto& node : graph.node()) {
    if (std::string fault = node_fault(node, known); !fault.empty()) return fault;
  }
  if (!known.contains(graph.output(0).name())) {
    return "no layer makes the network's output '" + graph.output(0).name() + "'";
  }
  return {};
}

}  // namespace

std::string onnx_fault(const onnx::ModelProto& model) {
  const onnx::GraphProto& graph = model.graph();
  if (graph.node().empty()) return "is not an ONNX network: there is no layer in it";
  if (graph.output_size() != 1) {
    return "has " + std::to_string(graph.output_size()) +
           " outputs; a network that labels range images has one";
  }
  if (network_input(graph) == nullptr) {
    return "does not have exactly one input; a network that labels range images has one";
  }
  if (std::string fault = weights_fault(graph); !fault.empty()) return fault;
  return nodes_fault(graph);
}

const onnx::ValueInfoProto* network_input(const onnx::GraphProto& graph) {
  const onnx::ValueInfoProto* found = nullptr;
  for (const onnx::ValueInfoProto& input : graph.input()) {
    if (is_weight(graph, input.name())) continue;
    if (found != nullptr) return nullptr;
    found = &input;
  }
  return found;
}

}  // namespace stillmap
