#include "core/segmentation/activation_ranges.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <numeric>

namespace stillmap {
namespace {

// Positive floating point numbers sort as their bits do: exponent and the upper bits of the
// mantissa number the bins. Those outside 2^-24 to 2^24 go into the first and the last.
constexpr std::uint32_t dropped_bits = 19;
constexpr std::uint32_t first_bits = std::bit_cast<std::uint32_t>(0x1p-24F) >> dropped_bits;
constexpr std::uint32_t last_bits = std::bit_cast<std::uint32_t>(0x1p24F) >> dropped_bits;
constexpr std::size_t bins = last_bits - first_bits + 1;

std::size_t bin_of(float magnitude) {
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(magnitude) >> dropped_bits;
  return std::clamp(bits, first_bits, last_bits) - first_bits;
}

float upper_edge(std::size_t bin) {
  return std::bit_cast<float>((static_cast<std::uint32_t>(bin) + first_bits + 1) << dropped_bits);
}

}  // namespace

void ActivationRanges::Histogram::add(float magnitude) {
  ++count[bin_of(magnitude)];
  largest = std::max(largest, magnitude);
}

float ActivationRanges::Histogram::range(double share) const {
  if (share >= 1.0) return largest;
  const auto total = std::accumulate(count.begin(), count.end(), std::uint64_t{0});
  const double wanted = share * static_cast<double>(total);
  double below = 0.0;
  std::size_t bin = 0;
  while (bin + 1 < bins && (below += count[bin]) < wanted) ++bin;
  return std::min(largest, upper_edge(bin));
}

void ActivationRanges::add(const std::string& tensor, std::span<const float> values,
                           std::size_t channels) {
  assert(channels > 0 && values.size() % channels == 0);
  std::vector<Histogram>& histograms = channels_of_tensor_[tensor];
  histograms.resize(channels, {.count = std::vector<std::uint32_t>(bins, 0)});
  for (std::size_t i = 0; i < values.size(); ++i) {
    const float magnitude = std::abs(values[i]);
    if (std::isfinite(magnitude)) histograms[i % channels].add(magnitude);
  }
}

std::map<std::string, std::vector<float>> ActivationRanges::ranges(double share) const {
  assert(share > 0.0 && share <= 1.0);
  std::map<std::string, std::vector<float>> ranges;
  for (const auto& [tensor, histograms] : channels_of_tensor_) {
    for (const Histogram& histogram : histograms) {
      ranges[tensor].push_back(histogram.range(share));
    }
  }
  return ranges;
}

}  // namespace stillmap
