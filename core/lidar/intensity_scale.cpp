#include "core/lidar/intensity_scale.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace stillmap {
namespace {

/// So many points tell what the numbers of all mean.
constexpr std::size_t max_samples = 8192;
/// Full scale may be overshot a little.
constexpr float overshoot = 1.5F;

/// Some thousand finite values from all over the scan.
std::vector<float> sample_of(std::span<const float> intensity) {
  std::vector<float> sample;
  const std::size_t step = intensity.size() / max_samples + 1;
  for (std::size_t i = 0; i < intensity.size(); i += step) {
    if (std::isfinite(intensity[i])) sample.push_back(intensity[i]);
  }
  return sample;
}

/// A percentile that a few bright or broken values do not move; 0 of no values.
float bright_value(std::vector<float>& sample) {
  if (sample.empty()) return 0.0F;
  const auto place = sample.begin() + static_cast<std::ptrdiff_t>(sample.size() * 99 / 100);
  std::ranges::nth_element(sample, place);
  return *place;
}

float full_scale_above(float bright) {
  for (const float scale : {1.0F, 255.0F}) {
    if (bright <= overshoot * scale) return scale;
  }
  return 65535.0F;
}

/// Values of 0..1: whole numbers could as well be a dark scan of a sensor that counts to 255.
bool fractions_only(const std::vector<float>& sample) {
  const auto within = [](float value) { return value >= 0.0F && value <= 1.0F; };
  const auto fraction = [](float value) { return value != std::floor(value); };
  return std::ranges::all_of(sample, within) && std::ranges::any_of(sample, fraction);
}

std::string remark(float full_scale) {
  return "intensity reaches " + std::to_string(static_cast<int>(full_scale)) +
         " and not what the sensor's intensity_scale says; it is divided by that";
}

}  // namespace

float intensity_full_scale(std::span<const float> intensity) {
  std::vector<float> sample = sample_of(intensity);
  return full_scale_above(bright_value(sample));
}

std::string IntensityScale::apply(std::span<float> intensity) {
  std::vector<float> sample = sample_of(intensity);
  std::string corrected;
  if (!sample.empty()) {
    const float bright = bright_value(sample);
    const bool too_bright = bright * factor_ > overshoot;
    if (too_bright || (first_ && factor_ < 1.0F && fractions_only(sample))) {
      const float full_scale = full_scale_above(bright);
      factor_ = 1.0F / full_scale;
      corrected = remark(full_scale);
    }
    first_ = false;
  }
  for (float& value : intensity) value *= factor_;
  return corrected;
}

}  // namespace stillmap
