#pragma once

#include <span>
#include <string>

namespace stillmap {

/// What the brightest surfaces have in a scan whose intensity is in the sensor's own numbers: 1,
/// 255 or 65535, the smallest that a few bright or broken values do not decide. Nothing finite
/// gives 1.
[[nodiscard]] float intensity_full_scale(std::span<const float> intensity);

/// The factor that brings a sensor's intensity to 0..1, held for a whole run, as single scans may
/// be dark.
class IntensityScale {
 public:
  /// As the sensor's description has it.
  explicit IntensityScale(float stated) : factor_(stated) {}

  /// Brings the values of one scan to 0..1. A description that contradicts them is corrected:
  /// brighter scans than it allows for raise the full scale (to 255 or 65535), and a first scan
  /// with nothing but fractions up to 1 lowers it. Returns what was corrected, in words, else
  /// nothing.
  [[nodiscard]] std::string apply(std::span<float> intensity);

  [[nodiscard]] float factor() const { return factor_; }

 private:
  float factor_;
  bool first_ = true;
};

}  // namespace stillmap
