#include "tests/segmentation/reference_network.hpp"

#include <cmath>

#include "core/segmentation/graph/network_graph.hpp"

namespace stillmap::test {
namespace {

std::size_t place(const ImageShape& shape, int channel, int row, int column) {
  return (static_cast<std::size_t>(channel) * static_cast<std::size_t>(shape.rows) +
          static_cast<std::size_t>(row)) *
             static_cast<std::size_t>(shape.columns) +
         static_cast<std::size_t>(column);
}

ReferenceTensor zeros(const ImageShape& shape) {
  return {.shape = shape, .values = std::vector<double>(shape.size(), 0.0)};
}

template <class Work>
void for_each_pixel(const ImageShape& shape, const Work& work) {
  for (int channel = 0; channel < shape.channels; ++channel) {
    for (int row = 0; row < shape.rows; ++row) {
      for (int column = 0; column < shape.columns; ++column) work(channel, row, column);
    }
  }
}

float weight(const std::vector<float>& weights, int first, int second, int seconds,
             const RowsColumns& kernel, int row, int column) {
  const ImageShape taps{.channels = 1, .rows = kernel.rows, .columns = kernel.columns};
  const auto pair = static_cast<std::size_t>(first) * static_cast<std::size_t>(seconds) +
                    static_cast<std::size_t>(second);
  return weights[pair * taps.size() + place(taps, 0, row, column)];
}

struct ReferenceLayer {
  const std::vector<const ReferenceTensor*>& inputs;
  const ImageShape& output_shape;

  [[nodiscard]] const ReferenceTensor& x() const { return *inputs.front(); }

  ReferenceTensor operator()(const Convolution& c) const {
    ReferenceTensor y = zeros(output_shape);
    for_each_pixel(y.shape, [&](int channel, int row, int column) {
      const int phase =
          row % c.upsampling.rows * c.upsampling.columns + column % c.upsampling.columns;
      const int output = phase * y.shape.channels + channel;
      double sum = c.bias[static_cast<std::size_t>(output)];
      for (int input = 0; input < c.inputs; ++input) {
        for (int kr = 0; kr < c.kernel.rows; ++kr) {
          for (int kc = 0; kc < c.kernel.columns; ++kc) {
            const int from_row =
                row / c.upsampling.rows * c.stride.rows + kr * c.dilation.rows - c.padding.top;
            const int from_column = column / c.upsampling.columns * c.stride.columns +
                                    kc * c.dilation.columns - c.padding.left;
            sum += double{weight(c.weights, output, input, c.inputs, c.kernel, kr, kc)} *
                   x().get(input, from_row, from_column);
          }
        }
      }
      y.at(channel, row, column) = sum;
    });
    return y;
  }

  ReferenceTensor operator()(const TransposedConvolution& c) const {
    ReferenceTensor y = zeros(output_shape);
    for_each_pixel(y.shape, [&](int channel, int row, int column) {
      y.at(channel, row, column) = c.bias[static_cast<std::size_t>(channel)];
    });
    for_each_pixel(x().shape, [&](int input, int row, int column) {
      for (int output = 0; output < c.outputs; ++output) {
        for (int kr = 0; kr < c.kernel.rows; ++kr) {
          for (int kc = 0; kc < c.kernel.columns; ++kc) {
            const int to_row = row * c.stride.rows + kr - c.padding.top;
            const int to_column = column * c.stride.columns + kc - c.padding.left;
            if (to_row < 0 || to_row >= y.shape.rows || to_column < 0 ||
                to_column >= y.shape.columns) {
              continue;
            }
            y.at(output, to_row, to_column) +=
                double{weight(c.weights, input, output, c.outputs, c.kernel, kr, kc)} *
                x().get(input, row, column);
          }
        }
      }
    });
    return y;
  }

  ReferenceTensor operator()(const BatchNorm& norm) const {
    ReferenceTensor y = x();
    for_each_pixel(y.shape, [&](int channel, int row, int column) {
      const auto c = static_cast<std::size_t>(channel);
      double& value = y.at(channel, row, column);
      value = norm.scale[c] * value + norm.offset[c];
    });
    return y;
  }

  ReferenceTensor operator()(const LeakyRelu& activation) const {
    ReferenceTensor y = x();
    for (double& value : y.values) value = value > 0.0 ? value : activation.slope * value;
    return y;
  }

  ReferenceTensor operator()(const Add&) const {
    ReferenceTensor y = x();
    for (std::size_t i = 0; i < y.values.size(); ++i) y.values[i] += inputs[1]->values[i];
    return y;
  }

  ReferenceTensor operator()(const Softmax&) const {
    ReferenceTensor y = x();
    const std::size_t pixels = y.shape.size() / static_cast<std::size_t>(y.shape.channels);
    for (std::size_t p = 0; p < pixels; ++p) {
      double sum = 0.0;
      for (std::size_t i = p; i < y.values.size(); i += pixels) {
        sum += y.values[i] = std::exp(y.values[i]);
      }
      for (std::size_t i = p; i < y.values.size(); i += pixels) y.values[i] /= sum;
    }
    return y;
  }
};

}  // namespace

double& ReferenceTensor::at(int channel, int row, int column) {
  return values[place(shape, channel, row, column)];
}

double ReferenceTensor::get(int channel, int row, int column) const {
  if (row < 0 || row >= shape.rows || column < 0 || column >= shape.columns) return 0.0;
  return values[place(shape, channel, row, column)];
}

ReferenceTensor run_reference(NetworkGraph graph, const ImageShape& shape,
                              std::span<const float> input) {
  infer_shapes(graph, shape);
  std::vector<ReferenceTensor> tensors(graph.tensors.size());
  tensors[graph.input] = {.shape = shape, .values = {input.begin(), input.end()}};
  for (const Layer& layer : graph.layers) {
    std::vector<const ReferenceTensor*> inputs;
    for (const TensorId id : layer.inputs) inputs.push_back(&tensors[id]);
    const ImageShape& output_shape = graph.tensors[layer.output].shape;
    ReferenceTensor result = std::visit(ReferenceLayer{inputs, output_shape}, layer.operation);
    for (const PostOp& step : layer.post_ops) {
      std::vector<const ReferenceTensor*> operands{&result};
      const ReferenceLayer follow{operands, output_shape};
      if (const auto* const sum = std::get_if<AddTensor>(&step)) {
        operands.push_back(&tensors[sum->other]);
        result = follow(Add{});
      } else {
        result = follow(std::get<LeakyRelu>(step));
      }
    }
    tensors[layer.output] = std::move(result);
  }
  return tensors[graph.output];
}

}  // namespace stillmap::test
