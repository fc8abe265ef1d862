#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/segmentation/onednn/execution_plan.hpp"

namespace stillmap {

/// A planned network as oneDNN primitives. All memory is allocated on construction; running
/// allocates none.
class CompiledPlan {
 public:
  /// `threads`: OpenMP threads per call, 0 for OpenMP's default. Throws UnsupportedLayer.
  CompiledPlan(const NetworkGraph& graph, const ExecutionPlan& plan, int threads);
  ~CompiledPlan();

  /// Called with each tensor that is stored in f32, rows x columns x channels.
  using Observer = std::function<void(TensorId, std::span<const float>)>;

  /// `input` is channels x rows x columns. Returns the network's output, rows x columns x channels,
  /// valid until the next run.
  std::span<const float> run(std::span<const float> input);
  std::span<const float> run(std::span<const float> input, const Observer& observer);

  [[nodiscard]] int threads() const;
  /// Bytes of activations and weights.
  [[nodiscard]] std::size_t memory_bytes() const;
  /// A line per step: what it does, and oneDNN's name of the implementation.
  [[nodiscard]] std::vector<std::string> steps() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stillmap
