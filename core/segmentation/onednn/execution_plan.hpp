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

/// How a number of a tensor is stored; s8 stands for `scale` times it.
enum class ValueType { f32, s8 };

/// Number of a piece of memory in its plan.
using BufferId = std::size_t;

/// One tensor in one type, rows x columns x channels in memory.
struct TensorPlacement {
  TensorId tensor = 0;
  ValueType type = ValueType::f32;
  BufferId buffer = 0;
};

/// The network's input, channels x rows x columns as it comes, laid out in a buffer.
struct LoadInput {
  TensorPlacement to;
};
/// The values of a buffer in another type, times `factor`; or a copy.
struct Convert {
  TensorPlacement from, to;
  float factor = 1.0F;
};
/// A convolution with its activations. With `sum_scale`, what lies in the target, of values of that
/// scale, is added; and then what lies in `added`.
struct Convolve {
  std::size_t layer = 0;
  TensorPlacement from, to;
  std::optional<float> sum_scale = {};
  std::optional<TensorPlacement> added = {};
};
/// Lays the row phases of a widening convolution's result out, times `factor`. With `sum_factor`,
/// what lies in the target times it is added.
struct LayOutRows {
  std::size_t layer = 0;
  TensorPlacement from, to;
  float factor = 1.0F;
  std::optional<float> sum_factor = {};
};
/// An activation that no convolution could take in.
struct Activate {
  TensorPlacement from, to;
  float slope = 0.0F;
};
/// A sum that no convolution could take in.
struct Sum {
  TensorPlacement first, second, to;
};

using Step = std::variant<LoadInput, Convert, Convolve, LayOutRows, Activate, Sum>;

/// Where a step writes.
[[nodiscard]] const TensorPlacement& target(const Step& step);

struct Buffer {
  std::size_t bytes = 0;
  /// Steps in which it holds something that is still needed, both included.
  std::size_t first_step = 0;
  std::size_t last_step = 0;
};

/// What is done in which order in which memory. Sums happen in place.
struct ExecutionPlan {
  std::vector<Step> steps;
  std::vector<Buffer> buffers;
  /// The network's output, in f32.
  TensorPlacement output;
  /// Factor of the s8 values of each tensor; 1 for those that have none.
  std::vector<float> scale_of_tensor;
};

/// Plans a graph whose shapes are known. With a calibration, convolutions run in 8-bit integers but
/// for the first, the last, and `float_layers`. Throws UnsupportedLayer for layers that have to be
/// replaced before, GraphFault when the calibration is not the network's.
[[nodiscard]] ExecutionPlan plan_execution(const NetworkGraph& graph,
                                           const Int8Calibration* calibration);

/// In which type each layer works and each tensor is stored first.
struct LayerPrecision {
  /// What a convolution multiplies.
  std::vector<ValueType> of_layer;
  std::vector<ValueType> of_tensor;
};

/// f32 throughout without a calibration. With one, convolutions multiply s8 but for those that read
/// the network's input or make its output and `float_layers`; a tensor is s8 when a convolution
/// that multiplies s8 makes it and another one wants it so.
[[nodiscard]] LayerPrecision layer_precision(const NetworkGraph& graph,
                                             const Int8Calibration* calibration);

/// Places in one block of memory.
struct BufferLayout {
  /// Byte at which each buffer begins, a multiple of `alignment`.
  std::vector<std::size_t> offset;
  std::size_t bytes = 0;

  static constexpr std::size_t alignment = 64;
};

/// Gives buffers that are needed at different times the same memory: the largest first, each as
/// low as it fits.
[[nodiscard]] BufferLayout lay_out(std::span<const Buffer> buffers);

}  // namespace stillmap
