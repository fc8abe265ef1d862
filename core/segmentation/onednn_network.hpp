#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/segmentation/model_description.hpp"
#include "core/segmentation/segmentation_network.hpp"

namespace stillmap {

/// Type of a network's operands.
enum class Precision { fp32, int8 };

/// Runs networks of the RangeNet family on oneDNN, several times faster than OpenCV: batch norms
/// and transposed convolutions become plain convolutions, activations and sums are fused into them,
/// and memory is planned once. int8: post-training quantisation, signed activations with one scale
/// per tensor, weights with one scale per output.
class OneDnnNetwork final : public SegmentationNetwork {
 public:
  /// Loads the network and runs it once. `threads`: OpenMP threads, 0 for OpenMP's default. Throws
  /// UnsupportedModel when the network has a layer that this engine does not support, ModelError
  /// when the file is damaged, does not fit its description, or has no calibration for int8.
  OneDnnNetwork(const ModelDescription& model, Precision precision, int threads = 0);
  ~OneDnnNetwork() override;

  [[nodiscard]] PixelOutputs run(std::span<const float> input) override;
  [[nodiscard]] std::vector<float> probabilities(std::span<const float> input) override;
  [[nodiscard]] std::string engine() const override;

  [[nodiscard]] int threads() const;

  /// Runs the network and calls `observer` with each tensor that it stores in floating point: name,
  /// values (rows x columns x channels), number of channels.
  using Observer = std::function<void(const std::string&, std::span<const float>, std::size_t)>;
  void observe(std::span<const float> input, const Observer& observer);

  /// Multiplications and additions per run, in 10^9.
  [[nodiscard]] double giga_operations() const;
  /// Bytes of weights and activations.
  [[nodiscard]] std::size_t memory_bytes() const;
  /// A line per step: what it does, and oneDNN's name of the implementation.
  [[nodiscard]] std::vector<std::string> steps() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// A product of two large square matrices on oneDNN: the machine's practical peak rate, with which
/// the rate of networks is compared.
class MatrixProduct {
 public:
  /// In fp32, or u8 times s8 for int8. `threads`: 0 for OpenMP's default.
  MatrixProduct(Precision precision, int threads);

  void run();
  /// Multiplications and additions per run, in 10^9.
  [[nodiscard]] static double giga_operations();

 private:
  Precision precision_;
  int threads_;
  std::vector<float> left_, right_, product_;
  std::vector<std::uint8_t> left_u8_;
  std::vector<std::int8_t> right_s8_;
  std::vector<std::int32_t> product_s32_;
};

}  // namespace stillmap
