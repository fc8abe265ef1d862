#include "core/segmentation/graph/network_graph.hpp"

#include <algorithm>

namespace stillmap {
namespace {

bool reads(const Layer& layer, TensorId tensor) {
  const auto adds = [tensor](const FollowUp& step) {
    const auto* const add = std::get_if<AddTensor>(&step);
    return add != nullptr && add->other == tensor;
  };
  return std::ranges::find(layer.inputs, tensor) != layer.inputs.end() ||
         std::ranges::any_of(layer.follow_ups, adds);
}

}  // namespace

std::string ImageShape::text() const {
  return std::to_string(channels) + "x" + std::to_string(rows) + "x" + std::to_string(columns);
}

std::vector<std::size_t> NetworkGraph::readers(TensorId tensor) const {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < layers.size(); ++i) {
    if (reads(layers[i], tensor)) found.push_back(i);
  }
  return found;
}

std::size_t NetworkGraph::maker(TensorId tensor) const {
  const auto layer = std::ranges::find(layers, tensor, &Layer::output);
  return static_cast<std::size_t>(layer - layers.begin());
}

}  // namespace stillmap
