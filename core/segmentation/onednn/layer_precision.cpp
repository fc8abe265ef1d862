#include "core/segmentation/onednn/layer_precision.hpp"

#include <algorithm>

namespace stillmap {
namespace {

bool in_integers(const NetworkGraph& graph, const Layer& layer,
                 const Int8Calibration& calibration) {
  return std::holds_alternative<Convolution>(layer.operation) &&
         layer.inputs.front() != graph.input && layer.output != graph.output &&
         std::ranges::find(calibration.float_layers, layer.name) == calibration.float_layers.end();
}

}  // namespace

LayerPrecision layer_precision(const NetworkGraph& graph, const Int8Calibration* calibration) {
  LayerPrecision precision{.of_layer = std::vector(graph.layers.size(), ValueType::f32),
                           .of_tensor = std::vector(graph.tensors.size(), ValueType::f32)};
  if (calibration == nullptr) return precision;
  std::vector<bool> wanted_s8(graph.tensors.size(), false);
  // From the end, so that all that read a tensor have said what they want before it is decided.
  for (std::size_t i = graph.layers.size(); i-- > 0;) {
    const Layer& layer = graph.layers[i];
    if (!in_integers(graph, layer, *calibration)) continue;
    precision.of_layer[i] = ValueType::s8;
    if (wanted_s8[layer.output]) precision.of_tensor[layer.output] = ValueType::s8;
    wanted_s8[layer.inputs.front()] = true;
    for (const PostOp& step : layer.post_ops) {
      const auto* const add = std::get_if<AddTensor>(&step);
      if (add != nullptr && wanted_s8[layer.output]) wanted_s8[add->other] = true;
    }
  }
  return precision;
}

}  // namespace stillmap
