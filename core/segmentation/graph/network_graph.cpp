#include "core/segmentation/graph/network_graph.hpp"

#include <algorithm>

namespace stillmap {
namespace {

bool reads(const Layer& layer, TensorId tensor) {
  const auto adds = [tensor](const PostOp& step) {
    const auto* const add = std::get_if<AddTensor>(&step);
    return add != nullptr && add->other == tensor;
  };
  return std::ranges::find(layer.inputs, tensor) != layer.inputs.end() ||
         std::ranges::any_of(layer.post_ops, adds);
}

}  // namespace

std::string ImageShape::text() const {
  return std::to_string(channels) + "x" + std::to_string(rows) + "x" + std::to_string(columns);
}

std::vector<std::size_t> NetworkGraph::consumers(TensorId tensor) const {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < layers.size(); ++i) {
    if (reads(layers[i], tensor)) found.push_back(i);
  }
  return found;
}

std::size_t NetworkGraph::producer(TensorId tensor) const {
  const auto layer = std::ranges::find(layers, tensor, &Layer::output);
  return static_cast<std::size_t>(layer - layers.begin());
}

}  // namespace stillmap
