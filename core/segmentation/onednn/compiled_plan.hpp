#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "core/segmentation/onednn/execution_plan.hpp"

namespace stillmap {

/// A planned network as oneDNN's primitives, with all the memory that it needs: running it takes
/// none.
class CompiledPlan {
 public:
  /// With so many OpenMP threads a call; 0: as many as OpenMP would take. Throws UnsupportedLayer.
  CompiledPlan(const NetworkGraph& graph, const ExecutionPlan& plan, int threads);
  ~CompiledPlan();

  /// Values of a tensor that was just stored in f32, rows x columns x channels.
  using Observer = std::function<void(TensorId, std::span<const float>)>;

  /// `input` is channels x rows x columns. Gives the network's output, rows x columns x channels,
  /// which lasts until the next run.
  std::span<const float> run(std::span<const float> input);
  std::span<const float> run(std::span<const float> input, const Observer& observer);

  [[nodiscard]] int threads() const;
  /// Bytes of activations and weights.
  [[nodiscard]] std::size_t memory_bytes() const;
  /// A line a step: what it does, and the name of oneDNN's code.
  [[nodiscard]] std::vector<std::string> steps() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace stillmap
