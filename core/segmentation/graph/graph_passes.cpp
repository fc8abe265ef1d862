#include "core/segmentation/graph/graph_passes.hpp"

#include <algorithm>
#include <cstddef>
#include <optional>

namespace stillmap {
namespace {

void fold_bias(std::vector<float>& bias, const BatchNorm& norm) {
  for (std::size_t o = 0; o < bias.size(); ++o) bias[o] = norm.scale[o] * bias[o] + norm.offset[o];
}

/// Folds the norm into an operation's weights; false when it has none.
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

bool fold_into_producer(NetworkGraph& graph, const Layer& layer) {
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
    if (fold_into_producer(graph, graph.layers[i])) {
      graph.layers.erase(graph.layers.begin() + static_cast<std::ptrdiff_t>(i));
    } else {
      ++i;
    }
  }
}

namespace {

/// Kernel taps of a transposed convolution along one axis: output stride q + phase gets tap k from
/// input q + (phase + padding - k) / stride.
class Taps {
 public:
  Taps(int kernel, int stride, int padding) : kernel_(kernel), stride_(stride), padding_(padding) {
    for (int phase = 0; phase < stride; ++phase) {
      for (int offset = -kernel; offset <= kernel + padding; ++offset) {
        if (tap(phase, offset) < 0) continue;
        first_ = std::min(first_, offset);
        last_ = std::max(last_, offset);
      }
    }
  }

  /// The tap that `phase` of output q gets from input q + offset; -1 if none.
  [[nodiscard]] int tap(int phase, int offset) const {
    const int k = phase + padding_ - offset * stride_;
    return k >= 0 && k < kernel_ ? k : -1;
  }

  [[nodiscard]] int first() const { return first_; }
  [[nodiscard]] int size() const { return last_ - first_ + 1; }
  [[nodiscard]] int before() const { return -first_; }
  [[nodiscard]] int after() const { return last_; }

 private:
  int kernel_, stride_, padding_;
  int first_ = 0;
  int last_ = 0;
};

class Replacement {
 public:
  explicit Replacement(const TransposedConvolution& from)
      : from_(from),
        rows_(from.kernel.rows, from.stride.rows, from.padding.top),
        columns_(from.kernel.columns, from.stride.columns, from.padding.left) {}

  [[nodiscard]] Convolution convolution() const {
    const int phases = from_.stride.rows * from_.stride.columns;
    Convolution to{.outputs = phases * from_.outputs,
                   .inputs = from_.inputs,
                   .kernel = {.rows = rows_.size(), .columns = columns_.size()},
                   .stride = {},
                   .dilation = {},
                   .padding = {.top = rows_.before(),
                               .left = columns_.before(),
                               .bottom = rows_.after(),
                               .right = columns_.after()},
                   .weights = {},
                   .bias = {},
                   .upsampling = from_.stride};
    for (int phase = 0; phase < phases; ++phase) add_phase(phase, to);
    return to;
  }

 private:
  void add_phase(int phase, Convolution& to) const {
    to.bias.insert(to.bias.end(), from_.bias.begin(), from_.bias.end());
    const int row_phase = phase / from_.stride.columns;
    const int column_phase = phase % from_.stride.columns;
    for (int output = 0; output < from_.outputs; ++output) {
      for (int input = 0; input < from_.inputs; ++input) {
        for (int r = 0; r < rows_.size(); ++r) {
          for (int c = 0; c < columns_.size(); ++c) {
            to.weights.push_back(weight(input, output, rows_.tap(row_phase, rows_.first() + r),
                                        columns_.tap(column_phase, columns_.first() + c)));
          }
        }
      }
    }
  }

  [[nodiscard]] float weight(int input, int output, int kernel_row, int kernel_column) const {
    if (kernel_row < 0 || kernel_column < 0) return 0.0F;
    const auto pair = static_cast<std::size_t>(input) * static_cast<std::size_t>(from_.outputs) +
                      static_cast<std::size_t>(output);
    const int taps = from_.kernel.rows * from_.kernel.columns;
    const int tap = kernel_row * from_.kernel.columns + kernel_column;
    return from_.weights[pair * static_cast<std::size_t>(taps) + static_cast<std::size_t>(tap)];
  }

  const TransposedConvolution& from_;
  Taps rows_, columns_;
};

void require_whole_multiple(const std::string& name, const TransposedConvolution& c) {
  const int rows = c.kernel.rows + c.extra.rows - c.padding.top - c.padding.bottom;
  const int columns = c.kernel.columns + c.extra.columns - c.padding.left - c.padding.right;
  if (rows == c.stride.rows && columns == c.stride.columns) return;
  throw UnsupportedLayer("layer '" + name +
                         "' is a transposed convolution whose output is not its stride times its "
                         "input");
}

}  // namespace

void replace_transposed_convolutions(NetworkGraph& graph) {
  for (Layer& layer : graph.layers) {
    const auto* const from = std::get_if<TransposedConvolution>(&layer.operation);
    if (from == nullptr) continue;
    require_whole_multiple(layer.name, *from);
    layer.operation = Replacement(*from).convolution();
  }
}

namespace {

std::ptrdiff_t count_sums(const Layer& layer) {
  return std::ranges::count_if(
      layer.post_ops, [](const PostOp& step) { return std::holds_alternative<AddTensor>(step); });
}

/// A sum as post-op of `layer`, if its other operand exists before `layer` runs.
std::optional<PostOp> sum_with(const NetworkGraph& graph, std::size_t layer, const Layer& sum) {
  const TensorId own = graph.layers[layer].output;
  const TensorId other = sum.inputs[0] == own ? sum.inputs[1] : sum.inputs[0];
  const bool known = other == graph.input || graph.producer(other) < layer;
  if (other == own || !known) return std::nullopt;
  return AddTensor{.other = other, .own = own};
}

std::optional<PostOp> as_post_op(const NetworkGraph& graph, std::size_t layer, const Layer& next) {
  const bool upsamples_rows =
      std::get<Convolution>(graph.layers[layer].operation).upsampling.rows > 1;
  // Rows are interleaved after all post-ops but the sum, which is added in the same step.
  if (count_sums(graph.layers[layer]) == (upsamples_rows ? 1 : 2)) return std::nullopt;
  if (const auto* const activation = std::get_if<LeakyRelu>(&next.operation)) return *activation;
  if (std::holds_alternative<Add>(next.operation)) return sum_with(graph, layer, next);
  return std::nullopt;
}

/// Fuses the layer that reads the result of layer `index` into it; false when that is impossible.
bool fuse_next(NetworkGraph& graph, std::size_t index) {
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
    while (fuse_next(graph, i)) {
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
