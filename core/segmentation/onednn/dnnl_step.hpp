#pragma once

#include <cstddef>
#include <dnnl.hpp>
#include <optional>
#include <string>
#include <unordered_map>

#include "core/segmentation/graph/network_graph.hpp"
#include "core/segmentation/onednn/execution_plan.hpp"

// Only the sources that make oneDNN's primitives include this.

namespace stillmap {

/// One call of oneDNN, with the memory that it works on.
struct DnnlStep {
  dnnl::primitive primitive;
  std::unordered_map<int, dnnl::memory> arguments;
  /// Memory that it wants while it runs.
  dnnl::memory::desc scratchpad;
  /// oneDNN's name of the code that runs it.
  std::string implementation;
};

/// A tensor as it lies in memory, and the factor of its values when they are s8.
struct DnnlTensor {
  void* memory = nullptr;
  ValueType type = ValueType::f32;
  float scale = 1.0F;
  ImageShape shape;

  [[nodiscard]] dnnl::memory::desc desc() const;
  [[nodiscard]] dnnl::memory dnnl_memory(const dnnl::engine& engine) const {
    return {desc(), engine, memory};
  }
};

[[nodiscard]] dnnl::memory::data_type dnnl_type(ValueType type);

/// Attributes that every primitive here has.
[[nodiscard]] dnnl::primitive_attr step_attributes();

/// What a convolution reads and writes. `to` and `added` have the shape before it is widened.
struct ConvolutionTensors {
  DnnlTensor from, to;
  /// Scale of what is in the target, to be added.
  std::optional<float> sum_scale;
  /// Added as well.
  std::optional<DnnlTensor> added;
};

/// The convolution of `layer`, which multiplies values of the type of `from`. Throws
/// UnsupportedLayer when oneDNN has only reference code for it.
[[nodiscard]] DnnlStep convolution_step(const dnnl::engine& engine, const Layer& layer,
                                        const ConvolutionTensors& tensors);

/// Copies values times `factor` into another layout or type.
[[nodiscard]] DnnlStep reorder_step(const dnnl::memory& from, const dnnl::memory& to, float factor);

[[nodiscard]] DnnlStep activation_step(const dnnl::engine& engine, const DnnlTensor& from,
                                       const DnnlTensor& to, float slope);
[[nodiscard]] DnnlStep sum_step(const dnnl::engine& engine, const DnnlTensor& first,
                                const DnnlTensor& second, const DnnlTensor& to);

}  // namespace stillmap
