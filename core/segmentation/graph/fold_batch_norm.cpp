#include "core/segmentation/graph/fold_batch_norm.hpp"

#include <algorithm>
#include <cstddef>

namespace stillmap {
namespace {

void fold_bias(std::vector<float>& bias, const BatchNorm& norm) {
  for (std::size_t o = 0; o < bias.size(); ++o) bias[o] = norm.scale[o] * bias[o] + norm.offset[o];
}

/// Works the norm into an operation's weights; false when it has none.
struct Fold {
  const BatchNorm& norm;

  bool operator()(Convolution& c) const {
    const std::size_t per_output = c.weights.size() / static_cast<std::size_t>(c.outputs);
    for (std::size_t i = 0; i < c.weights.size(); ++i) c.weights[i] *= norm.scale[i / per_output];
    fold_bias(c.bias, norm);
    return true;
  }
  bool operator()(TransposedConvolution& c) const {
    const auto outputs = static_cast<std::size_t>(c.outputs);
    const auto taps = static_cast<std::size_t>(c.kernel.rows * c.kernel.columns);
    for (std::size_t i = 0; i < c.weights.size(); ++i) {
      c.weights[i] *= norm.scale[i / taps % outputs];
    }
    fold_bias(c.bias, norm);
    return true;
  }
  template <class Other>
  bool operator()(Other& /*without_weights*/) const {
    return false;
  }
};

bool fold_into_maker(NetworkGraph& graph, const Layer& layer) {
  const auto* const norm = std::get_if<BatchNorm>(&layer.operation);
  if (norm == nullptr) return false;
  const TensorId normed = layer.inputs.front();
  const std::size_t producer = graph.producer(normed);
  if (producer == graph.layers.size() || graph.consumers(normed).size() != 1) return false;
  if (normed == graph.output || !std::visit(Fold{*norm}, graph.layers[producer].operation)) {
    return false;
  }
  graph.layers[producer].output = layer.output;
  return true;
}

}  // namespace

void fold_batch_norms(NetworkGraph& graph) {
  for (std::size_t i = 0; i < graph.layers.size();) {
    if (fold_into_maker(graph, graph.layers[i])) {
      graph.layers.erase(graph.layers.begin() + static_cast<std::ptrdiff_t>(i));
    } else {
      ++i;
    }
  }
}

}  // namespace stillmap
