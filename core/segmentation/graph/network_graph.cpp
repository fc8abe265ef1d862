#include "core/segmentation/graph/network_graph.hpp"

#include <algorithm>
#include <cstdint>

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

namespace {

/// Bound on the size of a tensor, 1 GiB in fp32; no network of the family comes near.
constexpr std::int64_t max_values = std::int64_t{1} << 28;

[[noreturn]] void refuse(const Layer& layer, const std::string& fault) {
  throw GraphFault("layer '" + layer.name + "' " + fault);
}

void require_channels(const Layer& layer, int wanted, const ImageShape& input) {
  if (input.channels == wanted) return;
  refuse(layer, "has weights for " + std::to_string(wanted) + " channels, but its input is " +
                    input.text());
}

ImageShape checked(const Layer& layer, int channels, std::int64_t rows, std::int64_t columns) {
  if (rows < 1 || columns < 1) refuse(layer, "leaves nothing of its input");
  if (rows > max_values || columns > max_values || rows * columns > max_values / channels) {
    refuse(layer, "would give " + std::to_string(channels) + "x" + std::to_string(rows) + "x" +
                      std::to_string(columns) + " values, which is absurd");
  }
  return {
      .channels = channels, .rows = static_cast<int>(rows), .columns = static_cast<int>(columns)};
}

/// Output size of a convolution along one axis.
std::int64_t output_size(std::int64_t size, std::int64_t padding, int kernel, int dilation,
                         int stride) {
  const std::int64_t reach = std::int64_t{dilation} * (kernel - 1) + 1;
  return size + padding < reach ? 0 : (size + padding - reach) / stride + 1;
}

/// Output shape of each kind of layer for the shape of its input.
struct OutputShape {
  const Layer& layer;
  const ImageShape& input;

  ImageShape operator()(const Convolution& c) const {
    require_channels(layer, c.inputs, input);
    const std::int64_t rows =
        output_size(input.rows, std::int64_t{c.padding.top} + c.padding.bottom, c.kernel.rows,
                    c.dilation.rows, c.stride.rows);
    const std::int64_t columns =
        output_size(input.columns, std::int64_t{c.padding.left} + c.padding.right, c.kernel.columns,
                    c.dilation.columns, c.stride.columns);
    return checked(layer, c.outputs / (c.upsampling.rows * c.upsampling.columns),
                   rows * c.upsampling.rows, columns * c.upsampling.columns);
  }
  ImageShape operator()(const TransposedConvolution& c) const {
    require_channels(layer, c.inputs, input);
    const auto upsampled = [](std::int64_t size, int stride, int kernel, std::int64_t padding,
                              int extra) { return (size - 1) * stride - padding + kernel + extra; };
    return checked(layer, c.outputs,
                   upsampled(input.rows, c.stride.rows, c.kernel.rows,
                             std::int64_t{c.padding.top} + c.padding.bottom, c.extra.rows),
                   upsampled(input.columns, c.stride.columns, c.kernel.columns,
                             std::int64_t{c.padding.left} + c.padding.right, c.extra.columns));
  }
  ImageShape operator()(const BatchNorm& norm) const {
    require_channels(layer, static_cast<int>(norm.scale.size()), input);
    return input;
  }
  ImageShape operator()(const LeakyRelu&) const { return input; }
  ImageShape operator()(const Add&) const { return input; }
  ImageShape operator()(const Softmax&) const { return input; }
};

void require_equal_shapes(const NetworkGraph& graph, const Layer& layer) {
  const ImageShape& first = graph.tensors[layer.inputs.front()].shape;
  for (const TensorId input : layer.inputs) {
    const ImageShape& shape = graph.tensors[input].shape;
    if (shape == first) continue;
    refuse(layer, "cannot add tensors of " + first.text() + " and " + shape.text());
  }
}

/// Factors by which a layer shrinks and enlarges its input.
struct Resampling {
  RowsColumns down, up;
};

Resampling resampling(const Operation& operation) {
  if (const auto* const c = std::get_if<Convolution>(&operation)) return {c->stride, c->upsampling};
  if (const auto* const c = std::get_if<TransposedConvolution>(&operation)) return {{}, c->stride};
  return {};
}

}  // namespace

RowsColumns network_stride(const NetworkGraph& graph) {
  constexpr int limit = 1 << 20;
  std::vector<RowsColumns> stride_of(graph.tensors.size());
  RowsColumns largest;
  for (const Layer& layer : graph.layers) {
    const RowsColumns before = stride_of[layer.inputs.front()];
    const Resampling step = resampling(layer.operation);
    RowsColumns& after = stride_of[layer.output];
    after.rows = std::max(1, before.rows * step.down.rows / step.up.rows);
    after.columns = std::max(1, before.columns * step.down.columns / step.up.columns);
    largest = {.rows = std::max(largest.rows, after.rows),
               .columns = std::max(largest.columns, after.columns)};
    if (largest.rows > limit || largest.columns > limit)
      refuse(layer, "narrows the image to nothing");
  }
  return largest;
}

void infer_shapes(NetworkGraph& graph, const ImageShape& input) {
  graph.tensors[graph.input].shape = input;
  for (const Layer& layer : graph.layers) {
    if (std::holds_alternative<Add>(layer.operation)) require_equal_shapes(graph, layer);
    const ImageShape& shape = graph.tensors[layer.inputs.front()].shape;
    graph.tensors[layer.output].shape = std::visit(OutputShape{layer, shape}, layer.operation);
  }
}

}  // namespace stillmap
