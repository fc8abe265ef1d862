#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace stillmap {

/// A network's decision for every pixel, row by row.
struct PixelOutputs {
  /// For pixels with NaN or infinite scores.
  static constexpr std::uint8_t no_output = 255;
  static constexpr std::size_t max_outputs = 255;

  /// Number of the most probable output.
  std::vector<std::uint8_t> output;
  /// Its probability, 0..1.
  std::vector<float> confidence;
};

/// A network loaded into an engine: a normalised range image in, classes out. Not thread-safe.
class SegmentationNetwork {
 public:
  virtual ~SegmentationNetwork() = default;

  /// The most probable output of every pixel. `input`: 5 x rows x columns, as from
  /// make_network_input().
  [[nodiscard]] virtual PixelOutputs run(std::span<const float> input) = 0;

  /// The probabilities of all outputs, outputs x rows x columns. Not finite where the network's
  /// scores are not.
  [[nodiscard]] virtual std::vector<float> probabilities(std::span<const float> input) = 0;

  /// Engine, precision and threads for the log: "oneDNN int8, 2 threads".
  [[nodiscard]] virtual std::string engine() const = 0;
};

}  // namespace stillmap
