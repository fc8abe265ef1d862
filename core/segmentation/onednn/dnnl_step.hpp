#pragma once

#include <cstddef>
#include <dnnl.hpp>
#include <optional>
#include <string>
#include <unordered_map>

#include "core/segmentation/graph/network_graph.hpp"
#include "core/segmentation/onednn/execution_plan.hpp"

// Includes dnnl.hpp: for sources that create oneDNN primitives only.

namespace stillmap {

/// A oneDNN primitive and its arguments.
struct DnnlStep {
  dnnl::primitive primitive;
  std::unordered_map<int, dnnl::memory> arguments;
  /// Scratch memory that it needs while it runs.
  dnnl::memory::desc scratchpad;
  /// oneDNN's name of the implementation.
  std::string implementation;
};

/// A tensor in memory; `scale` is that of s8 values.
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

/// Operands of a convolution. `to` and `added` have the shape before upsampling.
struct ConvolutionTensors {
  DnnlTensor from, to;
  /// Scale of the content of `to`, if that is added.
  std::optional<float> sum_scale;
  /// Another summand.
  std::optional<DnnlTensor> added;
};

/// The convolution of `layer`, in the type of `from`. Throws UnsupportedLayer when oneDNN has only
/// its slow reference implementation for it.
[[nodiscard]] DnnlStep convolution_step(const dnnl::engine& engine, const Layer& layer,
                                        const ConvolutionTensors& tensors);

/// Copies values times `factor` to another layout or type.
[[nodiscard]] DnnlStep reorder_step(const dnnl::memory& from, const dnnl::memory& to, float factor);

[[nodiscard]] DnnlStep activation_step(const dnnl::engine& engine, const DnnlTensor& from,
                                       const DnnlTensor& to, float slope);
[[nodiscard]] DnnlStep sum_step(const dnnl::engine& engine, const DnnlTensor& first,
                                const DnnlTensor& second, const DnnlTensor& to);

}  // namespace stillmap
