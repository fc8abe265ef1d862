#include "core/segmentation/graph/replace_transposed.hpp"

#include <algorithm>

namespace stillmap {
namespace {

/// How the taps of a transposed convolution fall on its input along one direction: output
/// stride q + phase gets tap k from input q + (phase + padding - k) / stride.
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

  /// The tap that `phase` of the output gets from the input `offset` places on; -1 if none.
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
                   .widen = from_.stride};
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

}  // namespace stillmap
