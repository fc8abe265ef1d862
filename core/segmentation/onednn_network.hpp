#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "core/segmentation/model_description.hpp"
#include "core/segmentation/segmentation_network.hpp"

namespace stillmap {

/// What a network multiplies.
enum class Precision { fp32, int8 };

/// Runs networks of the RangeNet family on oneDNN, several times as fast as OpenCV does: batch
/// norms and transposed convolutions are worked into plain convolutions, activations and sums are
/// done before a result is stored, memory is planned once. In 8-bit integers (post-training, signed
/// activations with one factor a tensor, weights with one an output) faster again.
class OneDnnNetwork final : public SegmentationNetwork {
 public:
  /// Loads the network and tries it once. `threads` bounds OpenMP's; 0 leaves them to it. Throws
  /// UnsupportedModel when there is something in the network that this engine does not run, and
  /// ModelError when the file is damaged, does not fit its description, or has no calibration for
  /// int8.
  OneDnnNetwork(const ModelDescription& model, Precision precision, int threads = 0);
  ~OneDnnNetwork() override;

  [[nodiscard]] PixelOutputs run(std::span<const float> input) override;
  [[nodiscard]] std::vector<float> probabilities(std::span<const float> input) override;
  [[nodiscard]] std::string engine() const override;

  /// Runs the network and shows each tensor that it stores in floating point: its name, its values
  /// as rows x columns x channels, and how many channels it has.
  using Observer = std::function<void(const std::string&, std::span<const float>, std::size_t)>;
  void observe(std::span<const float> input, const Observer& observer);

  /// Multiplications and additions a run, in 10^9.
  [[nodiscard]] double giga_operations() const;
  /// Bytes of weights and activations.
  [[nodiscard]] std::size_t memory_bytes() const;
  /// A line a step: what it does, and the name of oneDNN's code for it.
  [[nodiscard]] std::vector<std::string> steps() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// A product of two large square matrices on oneDNN: what the machine can do at its best, against
/// which networks are measured.
class MatrixProduct {
 public:
  /// In fp32, or u8 times s8 for int8, with so many threads; 0 leaves them to OpenMP.
  MatrixProduct(Precision precision, int threads);

  void run();
  /// Multiplications and additions of a run, in 10^9.
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
