#include "core/segmentation/graph/equalise_channels.hpp"

#include <algorithm>
#include <numeric>

namespace stillmap {
namespace {

using Factors = std::vector<float>;

/// Tensors that must have one set of factors, because they are added or are the same but for an
/// activation.
class Groups {
 public:
  explicit Groups(const NetworkGraph& graph) : parent_(graph.tensors.size()) {
    std::iota(parent_.begin(), parent_.end(), TensorId{0});
    for (const Layer& layer : graph.layers) {
      if (!std::holds_alternative<Convolution>(layer.operation)) {
        for (const TensorId input : layer.inputs) join(input, layer.output);
      }
      for (const PostOp& step : layer.post_ops) {
        const auto* const add = std::get_if<AddTensor>(&step);
        if (add == nullptr) continue;
        join(add->other, layer.output);
        join(add->own, layer.output);
      }
    }
  }

  [[nodiscard]] TensorId of(TensorId tensor) const {
    while (parent_[tensor] != tensor) tensor = parent_[tensor];
    return tensor;
  }

 private:
  void join(TensorId a, TensorId b) { parent_[of(a)] = of(b); }

  std::vector<TensorId> parent_;
};

/// The largest range of each channel over a group, over the largest of all; 1 for channels that are
/// always 0.
std::vector<Factors> factors_of_groups(const NetworkGraph& graph, const Groups& groups,
                                       const Int8Calibration& calibration) {
  std::vector<Factors> factors(graph.tensors.size());
  for (TensorId tensor = 0; tensor < graph.tensors.size(); ++tensor) {
    const auto known = calibration.range_of_channels.find(graph.tensors[tensor].name);
    if (known == calibration.range_of_channels.end()) continue;
    Factors& of_group = factors[groups.of(tensor)];
    of_group.resize(known->second.size(), 0.0F);
    std::ranges::transform(of_group, known->second, of_group.begin(),
                           [](float a, float b) { return std::max(a, b); });
  }
  factors[groups.of(graph.input)].clear();
  factors[groups.of(graph.output)].clear();
  for (Factors& of_group : factors) {
    const float most = of_group.empty() ? 0.0F : std::ranges::max(of_group);
    for (float& factor : of_group) factor = factor > 0.0F ? factor / most : 1.0F;
  }
  return factors;
}

void divide_outputs(Convolution& c, const Factors& factors) {
  if (factors.empty()) return;
  const std::size_t per_output = c.weights.size() / c.bias.size();
  for (std::size_t o = 0; o < c.bias.size(); ++o) c.bias[o] /= factors[o % factors.size()];
  for (std::size_t i = 0; i < c.weights.size(); ++i) {
    c.weights[i] /= factors[i / per_output % factors.size()];
  }
}

void multiply_inputs(Convolution& c, const Factors& factors) {
  if (factors.empty()) return;
  const auto taps = static_cast<std::size_t>(c.kernel.rows * c.kernel.columns);
  for (std::size_t i = 0; i < c.weights.size(); ++i) {
    c.weights[i] *= factors[i / taps % factors.size()];
  }
}

}  // namespace

Int8Calibration equalise_channels(NetworkGraph& graph, const Int8Calibration& calibration) {
  const Groups groups(graph);
  const std::vector<Factors> factors = factors_of_groups(graph, groups, calibration);
  for (Layer& layer : graph.layers) {
    auto* const c = std::get_if<Convolution>(&layer.operation);
    if (c == nullptr) continue;
    multiply_inputs(*c, factors[groups.of(layer.inputs.front())]);
    divide_outputs(*c, factors[groups.of(layer.output)]);
  }
  Int8Calibration equalised = calibration;
  for (TensorId tensor = 0; tensor < graph.tensors.size(); ++tensor) {
    const auto known = equalised.range_of_channels.find(graph.tensors[tensor].name);
    const Factors& of_group = factors[groups.of(tensor)];
    if (known == equalised.range_of_channels.end() || of_group.empty()) continue;
    std::ranges::transform(known->second, of_group, known->second.begin(), std::divides());
  }
  return equalised;
}

}  // namespace stillmap
