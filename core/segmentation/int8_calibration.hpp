#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace stillmap {

struct NetworkGraph;

/// What must be known of a network to run it with 8-bit integers; int8.yaml in a model folder.
struct Int8Calibration {
  /// From what, in words.
  std::string made;
  /// Largest magnitude that counts of each channel of each tensor; larger values are cut off. By
  /// the tensor's name in the network's file.
  std::map<std::string, std::vector<float>> range_of_channels;
  /// Layers that stay in floating point, besides the first and the last.
  std::vector<std::string> float_layers;
};

/// Watches how large the values of a network's tensors become, for its calibration.
class ActivationRanges {
 public:
  /// Adds the values that a tensor had for one image, pixels x channels.
  void add(const std::string& tensor, std::span<const float> values, std::size_t channels);

  /// The magnitude of each channel of each tensor that `share` of its values do not exceed, 0 <
  /// share <= 1 (up to 5 % more); with 1 the largest of all.
  [[nodiscard]] std::map<std::string, std::vector<float>> ranges(double share) const;

 private:
  struct Histogram {
    /// How many magnitudes are in each bin; 16 bins for each doubling.
    std::vector<std::uint32_t> count;
    float largest = 0.0F;

    void add(float magnitude);
    [[nodiscard]] float range(double share) const;
  };

  std::map<std::string, std::vector<Histogram>> channels_of_tensor_;
};

/// Makes the channels of each tensor about equally large, so that one factor for all of them, as
/// int8 has it, wastes no digits on small ones: what makes a channel is divided by its range, what
/// reads it multiplies by it. Convolutions, leaky ReLUs and sums let factors through, so the
/// network's output does not change. Tensors that are added share their factors; the network's
/// input and output, and what is added to them, keep theirs.
///
/// Gives the ranges that the channels have then. Tensors that the calibration does not know stay as
/// they are.
Int8Calibration equalise_channels(NetworkGraph& graph, const Int8Calibration& calibration);

}  // namespace stillmap
