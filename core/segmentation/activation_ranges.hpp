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
  /// Adds the values that a tensor had for one image.
  void add(const std::string& tensor, std::span<const float> values);

  /// The magnitude of each tensor that `share` of its values do not exceed (to 1 %), 0 < share <=
  /// 1; with 1 the largest of all.
  [[nodiscard]] std::map<std::string, float> ranges(double share) const;

 private:
  struct Histogram {
    /// How many magnitudes have these upper bits: 128 bins for each doubling.
    std::vector<std::uint64_t> count;
    float largest = 0.0F;

    [[nodiscard]] float range(double share) const;
  };

  std::map<std::string, Histogram> histograms_;
};

}  // namespace stillmap
