#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <variant>
#include <vector>

namespace stillmap {

/// One number for each direction of an image: the size of a kernel, a stride.
struct RowsColumns {
  int rows = 1;
  int columns = 1;
  friend bool operator==(const RowsColumns&, const RowsColumns&) = default;
};

/// Zeros that are put round an image.
struct Padding {
  int top = 0, left = 0, bottom = 0, right = 0;
  friend bool operator==(const Padding&, const Padding&) = default;
};

/// Size of the values at one place of a network, for one range image.
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

/// Number of a tensor in its graph.
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
  /// One an output.
  std::vector<float> bias;
  /// More than 1: the outputs are groups of channels (row phase x column phase x channel) that are
  /// laid out side by side, as a transposed convolution does: y(c, r widen + i, ...).
  RowsColumns widen;
};

/// Adds weights(i, o, kr, kc) x(i, r, c) to y(o, r stride + kr - top, ...), for all of them.
struct TransposedConvolution {
  int inputs = 0;
  int outputs = 0;
  RowsColumns kernel;
  RowsColumns stride;
  Padding padding;
  /// Rows and columns that the output has below and to the right of what the padding leaves.
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

/// Probabilities of scores, over the channels.
struct Softmax {};

using Operation =
    std::variant<Convolution, TransposedConvolution, BatchNorm, LeakyRelu, Add, Softmax>;

/// Adds this tensor to what a convolution gives.
struct AddTensor {
  TensorId other = 0;
  /// What it is added to, which the convolution would make without it.
  TensorId own = 0;
};
/// What is done to the result of a convolution before it is stored.
using PostOp = std::variant<LeakyRelu, AddTensor>;

struct Layer {
  /// As in the model's file.
  std::string name;
  Operation operation;
  std::vector<TensorId> inputs;
  TensorId output = 0;
  /// Of a convolution, in this order.
  std::vector<PostOp> post_ops = {};
};

struct Tensor {
  /// As in the model's file.
  std::string name;
  /// Known after infer_shapes().
  ImageShape shape = {};
};

/// A network for one image, its layers in an order in which they can be run. Each tensor but the
/// input is the output of exactly one layer.
struct NetworkGraph {
  std::vector<Tensor> tensors;
  std::vector<Layer> layers;
  TensorId input = 0;
  TensorId output = 0;

  /// Layers that read the tensor, in their order.
  [[nodiscard]] std::vector<std::size_t> consumers(TensorId tensor) const;
  /// The layer that makes the tensor; layers.size() for the input.
  [[nodiscard]] std::size_t producer(TensorId tensor) const;
};

/// A network that is wrong in itself.
class GraphFault : public std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A sound network with something in it that this engine does not run.
class UnsupportedLayer : public GraphFault {
  using GraphFault::GraphFault;
};

/// The network's strides: rows and columns of its image must be multiples of them, so that what
/// was narrowed fits again when it is widened.
[[nodiscard]] RowsColumns network_stride(const NetworkGraph& graph);

/// Works out the shape of every tensor for an input of this shape. Throws GraphFault where layers
/// do not fit together or a tensor would be absurdly large.
void infer_shapes(NetworkGraph& graph, const ImageShape& input);

}  // namespace stillmap
