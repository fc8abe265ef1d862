#include "core/segmentation/graph/fuse_post_ops.hpp"

#include <algorithm>
#include <optional>

namespace stillmap {
namespace {

std::ptrdiff_t count_sums(const Layer& layer) {
  return std::ranges::count_if(layer.follow_ups, [](const FollowUp& step) {
    return std::holds_alternative<AddTensor>(step);
  });
}

/// The other tensor of a sum, if there is one and it is known before `layer` runs.
std::optional<FollowUp> sum_with(const NetworkGraph& graph, std::size_t layer, const Layer& sum) {
  const TensorId own = graph.layers[layer].output;
  const TensorId other = sum.inputs[0] == own ? sum.inputs[1] : sum.inputs[0];
  const bool known = other == graph.input || graph.maker(other) < layer;
  if (other == own || !known) return std::nullopt;
  return AddTensor{.other = other, .own = own};
}

std::optional<FollowUp> as_follow_up(const NetworkGraph& graph, std::size_t layer,
                                     const Layer& next) {
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
  const std::vector<std::size_t> readers = graph.readers(layer.output);
  if (readers.size() != 1 || layer.output == graph.output) return false;
  const Layer& next = graph.layers[readers.front()];
  const std::optional<FollowUp> step = as_follow_up(graph, index, next);
  if (!step) return false;
  layer.follow_ups.push_back(*step);
  layer.output = next.output;
  graph.layers.erase(graph.layers.begin() + static_cast<std::ptrdiff_t>(readers.front()));
  return true;
}

}  // namespace

void fuse_follow_ups(NetworkGraph& graph) {
  for (std::size_t i = 0; i < graph.layers.size(); ++i) {
    if (!std::holds_alternative<Convolution>(graph.layers[i].operation)) continue;
    while (take_next(graph, i)) {
    }
  }
}

bool drop_final_softmax(NetworkGraph& graph) {
  const std::size_t maker = graph.maker(graph.output);
  if (maker == graph.layers.size()) return false;
  if (!std::holds_alternative<Softmax>(graph.layers[maker].operation)) return false;
  graph.output = graph.layers[maker].inputs.front();
  graph.layers.erase(graph.layers.begin() + static_cast<std::ptrdiff_t>(maker));
  return true;
}

}  // namespace stillmap
