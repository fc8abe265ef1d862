#include "core/segmentation/activation_ranges.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <numeric>

namespace stillmap {
namespace {

// Positive floating point numbers sort as their bits do.
constexpr std::uint32_t dropped_bits = 16;
constexpr std::size_t bins = std::size_t{1} << 15U;

std::size_t bin_of(float magnitude) {
  return std::bit_cast<std::uint32_t>(magnitude) >> dropped_bits;
}

float upper_edge(std::size_t bin) {
  return std::bit_cast<float>(static_cast<std::uint32_t>(bin + 1) << dropped_bits);
}

}  // namespace

void ActivationRanges::add(const std::string& tensor, std::span<const float> values) {
  Histogram& histogram = histograms_[tensor];
  histogram.count.resize(bins, 0);
  for (const float value : values) {
    const float magnitude = std::abs(value);
    if (!std::isfinite(magnitude)) continue;
    ++histogram.count[bin_of(magnitude)];
    histogram.largest = std::max(histogram.largest, magnitude);
  }
}

float ActivationRanges::Histogram::range(double share) const {
  const auto total = std::accumulate(count.begin(), count.end(), std::uint64_t{0});
  const double wanted = share * static_cast<double>(total);
  double below = 0.0;
  for (std::size_t bin = 0; bin < bins; ++bin) {
    below += static_cast<double>(count[bin]);
    if (below >= wanted) return std::min(largest, upper_edge(bin));
  }
  return largest;
}

std::map<std::string, float> ActivationRanges::ranges(double share) const {
  assert(share > 0.0 && share <= 1.0);
  std::map<std::string, float> ranges;
  for (const auto& [tensor, histogram] : histograms_) ranges[tensor] = histogram.range(share);
  return ranges;
}

}  // namespace stillmap
