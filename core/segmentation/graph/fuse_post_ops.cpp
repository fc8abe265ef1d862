#include "core/segmentation/graph/fuse_post_ops.hpp"

#include <algorithm>
#include <optional>

namespace stillmap {
namespace {

std::ptrdiff_t count_sums(const Layer& layer) {
  return std::ranges::count_if(
      layer.post_ops, [](const PostOp& step) { return std::holds_alternative<AddTensor>(step); });
}

/// The other tensor of a sum, if there is one and it is known before `layer` runs.
std::optional<PostOp> sum_with(const NetworkGraph& graph, std::size_t layer, const Layer& sum) {
  const TensorId own = graph.layers[layer].output;
  const TensorId other = sum.inputs[0] == own ? sum.inputs[1] : sum.inputs[0];
  const bool known = other == graph.input || graph.producer(other) < layer;
  if (other == own || !known) return std::nullopt;
  return AddTensor{.other = other, .own = own};
}

std::optional<PostOp> as_post_op(const NetworkGraph& graph, std::size_t layer, const Layer& next) {
  const bool widens_rows = std::get<Convolution>(graph.layers[layer].operation).widen.rows > 1;
  // Rows are widened after all else, together with a sum.
  if (count_sums(graph.layers[layer]) == (widens_rows ? 1 : 2)) return std::nullopt;
  if (const auto* const activation = std::get_if<LeakyRelu>(&next.operation)) return *activation;
  if (std::holds_alternative<Add>(next.operation)) return sum_with(graph, layer, next);
  return std::nullopt;
}

/// Takes in what comes next; false when nothing can be.
bool take_next(NetworkGraph& graph, std::size_t index) {
  Layer& layer = graph.layers[index];
  const std::vector<std::size_t> consumers = graph.consumers(layer.output);
  if (consumers.size() != 1 || layer.output == graph.output) return false;
  const Layer& next = graph.layers[consumers.front()];
  const std::optional<PostOp> step = as_post_op(graph, index, next);
  if (!step) return false;
  layer.post_ops.push_back(*step);
  layer.output = next.output;
  graph.layers.erase(graph.layers.begin() + static_cast<std::ptrdiff_t>(consumers.front()));
  return true;
}

}  // namespace

void fuse_post_ops(NetworkGraph& graph) {
  for (std::size_t i = 0; i < graph.layers.size(); ++i) {
    if (!std::holds_alternative<Convolution>(graph.layers[i].operation)) continue;
    while (take_next(graph, i)) {
    }
  }
}

bool drop_final_softmax(NetworkGraph& graph) {
  const std::size_t producer = graph.producer(graph.output);
  if (producer == graph.layers.size()) return false;
  if (!std::holds_alternative<Softmax>(graph.layers[producer].operation)) return false;
  graph.output = graph.layers[producer].inputs.front();
  graph.layers.erase(graph.layers.begin() + static_cast<std::ptrdiff_t>(producer));
  return true;
}

}  // namespace stillmap
