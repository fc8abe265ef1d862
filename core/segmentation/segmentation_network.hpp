#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace stillmap {

/// What a network says of every pixel, row by row.
struct PixelOutputs {
  /// Stands where the network gave no number (NaN or infinite scores).
  static constexpr std::uint8_t no_output = 255;
  static constexpr std::size_t max_outputs = 255;

  /// Number of the most probable output.
  std::vector<std::uint8_t> output;
  /// Its probability, 0..1.
  std::vector<float> confidence;
};

/// An engine with a network in it: a normalised range image in, the most probable output of every
/// pixel out.
class SegmentationNetwork {
 public:
  virtual ~SegmentationNetwork() = default;

  /// `input` is 5 x rows x columns, as make_network_input() gives it.
  [[nodiscard]] virtual PixelOutputs run(std::span<const float> input) = 0;
};

}  // namespace stillmap
