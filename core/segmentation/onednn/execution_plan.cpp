#include "core/segmentation/onednn/execution_plan.hpp"

#include <algorithm>
#include <array>
#include <numeric>

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
  // Backwards, so that all readers of a tensor are visited before its producer.
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

namespace {

constexpr float largest_s8 = 127.0F;

std::size_t bytes_of(ValueType type) { return type == ValueType::s8 ? 1 : sizeof(float); }

/// The sums that are fused into a convolution, none to two.
std::vector<AddTensor> sums_of(const Layer& layer) {
  std::vector<AddTensor> sums;
  for (const PostOp& step : layer.post_ops) {
    if (const auto* const add = std::get_if<AddTensor>(&step)) sums.push_back(*add);
  }
  return sums;
}

class Planner {
 public:
  Planner(const NetworkGraph& graph, const Int8Calibration* calibration, FloatSummand float_summand)
      : graph_(graph),
        calibration_(calibration),
        float_summand_(float_summand),
        precision_(layer_precision(graph, calibration)),
        versions_(graph.tensors.size()) {
    plan_.scale_of_tensor.assign(graph.tensors.size(), 1.0F);
  }

  ExecutionPlan plan() {
    add_step(LoadInput{.to = new_place(graph_.input, ValueType::f32)});
    for (std::size_t i = 0; i < graph_.layers.size(); ++i) plan_layer(i);
    plan_.output = version(graph_.output, ValueType::f32);
    plan_.buffers[plan_.output.buffer].last_step = plan_.steps.size();
    return std::move(plan_);
  }

 private:
  void plan_layer(std::size_t index) {
    const Layer& layer = graph_.layers[index];
    if (std::holds_alternative<Convolution>(layer.operation)) {
      plan_convolution(index);
    } else if (const auto* const activation = std::get_if<LeakyRelu>(&layer.operation)) {
      const TensorPlacement from = version(layer.inputs.front(), ValueType::f32);
      add_step(Activate{from, new_place(layer.output, ValueType::f32), activation->slope});
    } else if (std::holds_alternative<Add>(layer.operation)) {
      const TensorPlacement first = version(layer.inputs[0], ValueType::f32);
      const TensorPlacement second = version(layer.inputs[1], ValueType::f32);
      add_step(Sum{first, second, new_place(layer.output, ValueType::f32)});
    } else {
      throw UnsupportedLayer("layer '" + layer.name +
                             "' is a batch norm that does not follow a convolution alone, or a "
                             "soft-max that is not the last layer: neither is supported");
    }
  }

  void plan_convolution(std::size_t index) {
    const Layer& layer = graph_.layers[index];
    if (std::get<Convolution>(layer.operation).upsampling.rows > 1) {
      plan_row_upsampling(index);
      return;
    }
    const ValueType type = precision_.of_tensor[layer.output];
    const TensorPlacement from = version(layer.inputs.front(), precision_.of_layer[index]);
    const std::vector<AddTensor> sums = sums_of(layer);
    std::optional<TensorPlacement> added;
    if (sums.size() > 1) added = version(sums[1].other, type);
    if (precision_.of_layer[index] != ValueType::f32) {
      const auto [to, sum_scale] = result_place(index, from, type);
      add_step(Convolve{index, from, to, sum_scale, added});
      return;
    }
    std::optional<TensorPlacement> apart;
    if (!sums.empty() && float_summand_ == FloatSummand::apart) {
      apart = version(sums.front().other, type);
    }
    const auto [to, sum_scale] = apart ? Result{new_place(layer.output, type), std::nullopt}
                                       : result_place(index, from, type);
    // oneDNN can do both sums of a convolution in integers only.
    const TensorPlacement first_sum{added ? sums[1].own : layer.output, type, to.buffer};
    add_step(Convolve{index, from, first_sum, sum_scale, apart});
    if (added) add_step(Sum{first_sum, *added, to});
  }

  void plan_row_upsampling(std::size_t index) {
    const Layer& layer = graph_.layers[index];
    const ValueType type = precision_.of_tensor[layer.output];
    const TensorPlacement from = version(layer.inputs.front(), precision_.of_layer[index]);
    const std::vector<AddTensor> sums = sums_of(layer);
    const TensorPlacement phases = new_place(sums.empty() ? layer.output : sums.front().own, type);
    add_step(Convolve{index, from, phases, {}, {}});
    const auto [to, sum_scale] = result_place(index, phases, type);
    std::optional<float> sum_factor;
    if (sum_scale) sum_factor = *sum_scale / scale_of(to);
    add_step(InterleaveRows{index, phases, to, scale_of(phases) / scale_of(to), sum_factor});
  }

  struct Result {
    TensorPlacement place;
    std::optional<float> sum_scale;
  };

  /// The target of a convolution: the buffer of the tensor that it is added to, copied first when
  /// that is read again or is `from`, or a new buffer.
  Result result_place(std::size_t index, const TensorPlacement& from, ValueType type) {
    const Layer& layer = graph_.layers[index];
    const std::vector<AddTensor> sums = sums_of(layer);
    if (sums.empty()) return {new_place(layer.output, type), std::nullopt};
    const TensorId summand = sums.front().other;
    TensorPlacement other = version(summand, type);
    const bool added_twice = sums.size() > 1 && sums[1].other == summand;
    if (!is_last_reader(index, summand) || other.buffer == from.buffer || added_twice) {
      const TensorPlacement copy{summand, type, new_buffer(summand, type)};
      add_step(Convert{other, copy, 1.0F});
      other = copy;
    }
    const TensorPlacement to{layer.output, type, other.buffer};
    set_scale(to);
    versions_[to.tensor][static_cast<std::size_t>(type)] = to;
    return {to, scale_of(other)};
  }

  [[nodiscard]] bool is_last_reader(std::size_t layer, TensorId tensor) const {
    return tensor != graph_.output && graph_.consumers(tensor).back() == layer;
  }

  /// A tensor in this type; adds a conversion when it does not exist yet.
  TensorPlacement version(TensorId tensor, ValueType type) {
    std::optional<TensorPlacement>& wanted = versions_[tensor][static_cast<std::size_t>(type)];
    if (wanted) return *wanted;
    const ValueType there = type == ValueType::f32 ? ValueType::s8 : ValueType::f32;
    const TensorPlacement from = *versions_[tensor][static_cast<std::size_t>(there)];
    const TensorPlacement to = new_place(tensor, type);
    const float scale = plan_.scale_of_tensor[tensor];
    add_step(Convert{from, to, type == ValueType::f32 ? scale : 1.0F / scale});
    return to;
  }

  TensorPlacement new_place(TensorId tensor, ValueType type) {
    const TensorPlacement place{tensor, type, new_buffer(tensor, type)};
    versions_[tensor][static_cast<std::size_t>(type)] = place;
    set_scale(place);
    return place;
  }

  BufferId new_buffer(TensorId tensor, ValueType type) {
    const std::size_t now = plan_.steps.size();
    const std::size_t bytes = graph_.tensors[tensor].shape.size() * bytes_of(type);
    plan_.buffers.push_back({.bytes = bytes, .first_step = now, .last_step = now});
    return plan_.buffers.size() - 1;
  }

  void set_scale(const TensorPlacement& place) {
    if (place.type != ValueType::s8) return;
    const std::string& name = graph_.tensors[place.tensor].name;
    const auto ranges = calibration_->range_of_channels.find(name);
    if (ranges == calibration_->range_of_channels.end() || ranges->second.empty()) {
      throw GraphFault("its int8 calibration has no range for tensor '" + name +
                       "': it is another network's; calibrate again");
    }
    // The range is 0 for a tensor that was 0 in all calibration scans.
    const float range = std::ranges::max(ranges->second);
    plan_.scale_of_tensor[place.tensor] = range > 0.0F ? range / largest_s8 : 1.0F;
  }

  /// Factor from stored to real values.
  [[nodiscard]] float scale_of(const TensorPlacement& place) const {
    return place.type == ValueType::s8 ? plan_.scale_of_tensor[place.tensor] : 1.0F;
  }

  void add_step(const Step& step) {
    const std::size_t number = plan_.steps.size();
    const auto use = [&](const TensorPlacement& place) {
      plan_.buffers[place.buffer].last_step = number;
    };
    use(target(step));
    std::visit(
        [&](const auto& s) {
          if constexpr (requires { s.from; }) use(s.from);
          if constexpr (requires { s.first; }) use(s.first);
          if constexpr (requires { s.second; }) use(s.second);
          if constexpr (requires { s.added; }) {
            if (s.added) use(*s.added);
          }
        },
        step);
    plan_.steps.push_back(step);
  }

  const NetworkGraph& graph_;
  const Int8Calibration* calibration_;
  FloatSummand float_summand_;
  LayerPrecision precision_;
  /// For each tensor its placement by type.
  std::vector<std::array<std::optional<TensorPlacement>, 2>> versions_;
  ExecutionPlan plan_;
};

}  // namespace

const TensorPlacement& target(const Step& step) {
  return std::visit([](const auto& s) -> const TensorPlacement& { return s.to; }, step);
}

ExecutionPlan plan_execution(const NetworkGraph& graph, const Int8Calibration* calibration,
                             FloatSummand float_summand) {
  return Planner(graph, calibration, float_summand).plan();
}

namespace {

std::size_t aligned(std::size_t bytes) {
  return (bytes + BufferLayout::alignment - 1) / BufferLayout::alignment * BufferLayout::alignment;
}

bool at_one_time(const Buffer& a, const Buffer& b) {
  return a.first_step <= b.last_step && b.first_step <= a.last_step;
}

}  // namespace

BufferLayout lay_out(std::span<const Buffer> buffers) {
  std::vector<std::size_t> by_size(buffers.size());
  std::iota(by_size.begin(), by_size.end(), std::size_t{0});
  std::ranges::stable_sort(by_size, std::ranges::greater(),
                           [&](std::size_t i) { return buffers[i].bytes; });
  BufferLayout layout{.offset = std::vector<std::size_t>(buffers.size(), 0)};
  // Placed buffers from the lowest to the highest.
  std::vector<std::size_t> placed;
  for (const std::size_t i : by_size) {
    std::size_t& offset = layout.offset[i];
    for (const std::size_t other : placed) {
      if (!at_one_time(buffers[i], buffers[other])) continue;
      if (offset + aligned(buffers[i].bytes) <= layout.offset[other]) break;
      offset = std::max(offset, layout.offset[other] + aligned(buffers[other].bytes));
    }
    const auto above = std::ranges::upper_bound(
        placed, offset, {}, [&](std::size_t other) { return layout.offset[other]; });
    placed.insert(above, i);
    layout.bytes = std::max(layout.bytes, offset + aligned(buffers[i].bytes));
  }
  return layout;
}

}  // namespace stillmap
