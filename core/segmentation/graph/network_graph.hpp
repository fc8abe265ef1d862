#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

namespace stillmap {

/// A number for each axis of an image: the size of a kernel, a stride.
struct RowsColumns {
  int rows = 1;
  int columns = 1;
  friend bool operator==(const RowsColumns&, const RowsColumns&) = default;
};

/// Zeros added around an image.
struct Padding {
  int top = 0, left = 0, bottom = 0, right = 0;
  friend bool operator==(const Padding&, const Padding&) = default;
};

/// Shape of a tensor, for one range image.
struct ImageShape {
  int channels = 0, rows = 0, columns = 0;

  [[nodiscard]] std::size_t size() const {
    return static_cast<std::size_t>(channels) * static_cast<std::size_t>(rows) *
           static_cast<std::size_t>(columns);
  }
  /// "64x16x512"
  [[nodiscard]] std::string text() const;
  friend bool operator==(const ImageShape&, const ImageShape&) = default;
};

/// Index into NetworkGraph::tensors.
using TensorId = std::size_t;

/// y(o, r, c) = bias(o) + sum of weights(o, i, kr, kc) x(i, r stride + kr dilation - top, ...).
struct Convolution {
  int outputs = 0;
  int inputs = 0;
  RowsColumns kernel;
  RowsColumns stride;
  RowsColumns dilation;
  Padding padding;
  /// outputs x inputs x kernel rows x kernel columns
  std::vector<float> weights;
  /// One per output.
  std::vector<float> bias;
  /// Above 1 a depth-to-space step follows: the outputs are row phase x column phase x channel, and
  /// phase i of row r becomes row r upsampling + i; the same with columns.
  RowsColumns upsampling;
};

/// y(o, r stride + kr - top, ...) = bias(o) + sum of weights(i, o, kr, kc) x(i, r, c).
struct TransposedConvolution {
  int inputs = 0;
  int outputs = 0;
  RowsColumns kernel;
  RowsColumns stride;
  Padding padding;
  /// ONNX's output_padding: further rows and columns at the bottom and the right of the output.
  RowsColumns extra{.rows = 0, .columns = 0};
  /// inputs x outputs x kernel rows x kernel columns
  std::vector<float> weights;
  std::vector<float> bias;
};

/// y(c) = scale(c) x(c) + offset(c).
struct BatchNorm {
  std::vector<float> scale;
  std::vector<float> offset;
};

/// y = x where x > 0, else slope x. A plain ReLU has slope 0.
struct LeakyRelu {
  float slope = 0.0F;
};

/// The sum of two tensors of one shape.
struct Add {};

/// Soft-max over the channels.
struct Softmax {};

using Operation =
    std::variant<Convolution, TransposedConvolution, BatchNorm, LeakyRelu, Add, Softmax>;

/// Adds a tensor to the result of a convolution.
struct AddTensor {
  TensorId other = 0;
  /// The convolution's result before this sum.
  TensorId own = 0;
};
/// Applied to the result of a convolution before it is stored.
using PostOp = std::variant<LeakyRelu, AddTensor>;

struct Layer {
  /// As in the model's file.
  std::string name;
  Operation operation;
  std::vector<TensorId> inputs;
  TensorId output = 0;
  /// Of a convolution, in the order in which they are applied.
  std::vector<PostOp> post_ops = {};
};

struct Tensor {
  /// As in the model's file.
  std::string name;
  /// Set by infer_shapes().
  ImageShape shape = {};
};

/// A network for one image, its layers in topological order. Each tensor but the input is the
/// output of exactly one layer.
struct NetworkGraph {
  std::vector<Tensor> tensors;
  std::vector<Layer> layers;
  TensorId input = 0;
  TensorId output = 0;

  /// Indices of the layers that read the tensor, in ascending order.
  [[nodiscard]] std::vector<std::size_t> consumers(TensorId tensor) const;
  /// Index of the layer whose output the tensor is; layers.size() for the input.
  [[nodiscard]] std::size_t producer(TensorId tensor) const;
};

/// An invalid network.
class GraphFault : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A valid network with a layer that this engine does not support.
class UnsupportedLayer : public GraphFault {
  using GraphFault::GraphFault;
};

/// The largest downsampling within the network: rows and columns of its image must be multiples of
/// it, so that skip connections fit.
[[nodiscard]] RowsColumns network_stride(const NetworkGraph& graph);

/// Sets the shape of every tensor for an input of this shape. Throws GraphFault where layers do not
/// fit together or a tensor would be too large.
void infer_shapes(NetworkGraph& graph, const ImageShape& input);

}  // namespace stillmap
