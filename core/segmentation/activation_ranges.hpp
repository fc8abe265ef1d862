#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "core/segmentation/int8_calibration.hpp"

namespace stillmap {

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

}  // namespace stillmap
