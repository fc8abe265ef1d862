#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "core/segmentation/graph/network_graph.hpp"
#include "core/segmentation/int8_calibration.hpp"

namespace stillmap {

/// Type of a tensor's stored values; s8 values are multiples of the tensor's scale.
enum class ValueType { f32, s8 };

/// The types that layers compute in, and in which tensors are first stored.
struct LayerPrecision {
  /// Type of a convolution's operands.
  std::vector<ValueType> of_layer;
  std::vector<ValueType> of_tensor;
};

/// f32 throughout without a calibration. With one, convolutions compute in s8 except those that
/// read the network's input or produce its output and `float_layers`; a tensor is s8 when a
/// convolution in s8 produces it and another one reads it.
[[nodiscard]] LayerPrecision layer_precision(const NetworkGraph& graph,
                                             const Int8Calibration* calibration);

/// Index into ExecutionPlan::buffers.
using BufferId = std::size_t;

/// A tensor of one type in a buffer, rows x columns x channels in memory.
struct TensorPlacement {
  TensorId tensor = 0;
  ValueType type = ValueType::f32;
  BufferId buffer = 0;
};

/// Copies the network's input, channels x rows x columns, into a buffer.
struct LoadInput {
  TensorPlacement to;
};
/// Copies a tensor times `factor`, into another type or the same.
struct Convert {
  TensorPlacement from, to;
  float factor = 1.0F;
};
/// A convolution with its post-ops. With `sum_scale` the content of the target, of this scale, is
/// added, and after it, or alone, the content of `added`.
struct Convolve {
  std::size_t layer = 0;
  TensorPlacement from, to;
  std::optional<float> sum_scale = {};
  std::optional<TensorPlacement> added = {};
};
/// Interleaves the row phases of an upsampling convolution's result, times `factor`. With
/// `sum_factor` the content of the target times it is added.
struct InterleaveRows {
  std::size_t layer = 0;
  TensorPlacement from, to;
  float factor = 1.0F;
  std::optional<float> sum_factor = {};
};
/// An activation that is not fused into a convolution.
struct Activate {
  TensorPlacement from, to;
  float slope = 0.0F;
};
/// A sum that is not fused into a convolution.
struct Sum {
  TensorPlacement first, second, to;
};

using Step = std::variant<LoadInput, Convert, Convolve, InterleaveRows, Activate, Sum>;

/// The tensor that a step writes.
[[nodiscard]] const TensorPlacement& target(const Step& step);

/// Memory that tensors share, one after the other.
struct Buffer {
  std::size_t bytes = 0;
  /// Lifetime of its content, both steps included.
  std::size_t first_step = 0;
  std::size_t last_step = 0;
};

/// Where a convolution in floating point finds what is added to it.
enum class FloatSummand {
  /// In its target.
  in_place,
  /// In a buffer of its own, which takes more memory: oneDNN's code for AVX2 adds in place only
  /// before the activation, and RangeNet++ adds after it.
  apart,
};

/// Steps in their order, and the buffers they work on. Sums are computed in place.
struct ExecutionPlan {
  std::vector<Step> steps;
  std::vector<Buffer> buffers;
  /// The network's output, in f32.
  TensorPlacement output;
  /// Scale of the s8 values of each tensor; 1 for those that are not stored in s8.
  std::vector<float> scale_of_tensor;
};

/// Plans a graph with shapes, in the types of layer_precision(). Throws UnsupportedLayer for layers
/// that the passes should have replaced, GraphFault when the calibration lacks a tensor.
[[nodiscard]] ExecutionPlan plan_execution(const NetworkGraph& graph,
                                           const Int8Calibration* calibration,
                                           FloatSummand float_summand = FloatSummand::in_place);

/// Buffers in one block of memory.
struct BufferLayout {
  /// Offset of each buffer in bytes, a multiple of `alignment`.
  std::vector<std::size_t> offset;
  std::size_t bytes = 0;

  static constexpr std::size_t alignment = 64;
};

/// Buffers with disjoint lifetimes share memory. Greedy: the largest first, each at the lowest
/// offset where it fits.
[[nodiscard]] BufferLayout lay_out(std::span<const Buffer> buffers);

}  // namespace stillmap
