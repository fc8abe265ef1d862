#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace stillmap {

struct NetworkGraph;

/// Post-training quantisation of a network to 8-bit integers; int8.yaml in a model folder.
struct Int8Calibration {
  /// Data and settings that it was made with, in words.
  std::string made;
  /// By the tensor's name in the network's file: the magnitude at which each channel saturates.
  std::map<std::string, std::vector<float>> range_of_channels;
  /// Layers that stay in floating point, besides the first and the last.
  std::vector<std::string> float_layers;
  /// crc32_of() the network's file that it was made with; empty where that is not known.
  std::string network_crc32 = {};
};

/// CRC-32 of a file's bytes as eight hexadecimal digits; empty where it cannot be read.
[[nodiscard]] std::string crc32_of(const std::filesystem::path& file);

/// Histograms of the magnitudes in a network's tensors, from which a calibration is made.
class ActivationRanges {
 public:
  /// Adds the values of a tensor for one image, pixels x channels.
  void add(const std::string& tensor, std::span<const float> values, std::size_t channels);

  /// For each channel of each tensor the magnitude that `share` of its values do not exceed,
  /// rounded up by at most 5 %; the maximum for share = 1. 0 < share <= 1.
  [[nodiscard]] std::map<std::string, std::vector<float>> ranges(double share) const;

 private:
  struct Histogram {
    /// Number of magnitudes in each bin; 16 bins per octave.
    std::vector<std::uint32_t> count;
    float largest = 0.0F;

    void add(float magnitude);
    [[nodiscard]] float range(double share) const;
  };

  std::map<std::string, std::vector<Histogram>> channels_of_tensor_;
};

/// Which float layer is none of these layers of a network's file; empty where all are.
[[nodiscard]] std::string float_layer_fault(std::span<const std::string> layers,
                                            const Int8Calibration& calibration);

/// Why this calibration is not one of this network (after infer_shapes()), with the tensor and the
/// numbers; empty where it is. Tensors without an entry are no fault here: some need none.
[[nodiscard]] std::string calibration_fault(const NetworkGraph& graph,
                                            const Int8Calibration& calibration);

/// Cross-layer equalisation (M. Nagel et al., ICCV 2019): scales the channels of each tensor to
/// about the same range, since int8 has one scale for all channels of a tensor. The weights that
/// produce a channel are divided by its range, those that read it are multiplied by it.
/// Convolutions, leaky ReLUs and sums commute with positive factors, so the network's output does
/// not change. Tensors that are added share their factors; the network's input and output, and
/// tensors added to them, keep their scale, and so do tensors without an entry in the calibration.
///
/// The calibration has no calibration_fault(). Returns that of the changed graph.
Int8Calibration equalise_channels(NetworkGraph& graph, const Int8Calibration& calibration);

}  // namespace stillmap
