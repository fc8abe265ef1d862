#include "core/segmentation/int8_calibration.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <fstream>
#include <iomanip>
#include <numeric>
#include <sstream>

#include "core/segmentation/graph/network_graph.hpp"

namespace stillmap {
namespace {

// Positive floats sort like their bit patterns: the exponent and the upper bits of the mantissa are
// the index of the bin. Magnitudes outside 2^-24 .. 2^24 go into the first and the last bin.
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

namespace {

using Factors = std::vector<float>;

/// Disjoint sets of tensors that must share their factors, since they are added or differ only by
/// an activation.
class TensorGroups {
 public:
  explicit TensorGroups(const NetworkGraph& graph) : parent_(graph.tensors.size()) {
    std::iota(parent_.begin(), parent_.end(), TensorId{0});
    for (const Layer& layer : graph.layers) {
      if (!std::holds_alternative<Convolution>(layer.operation)) {
        for (const TensorId input : layer.inputs) join(input, layer.output);
      }
      for (const PostOp& step : layer.post_ops) {
        const auto* const add = std::get_if<AddTensor>(&step);
        if (add == nullptr) continue;
        join(add->other, layer.output);
        join(add->own, layer.output);
      }
    }
  }

  [[nodiscard]] TensorId of(TensorId tensor) const {
    while (parent_[tensor] != tensor) tensor = parent_[tensor];
    return tensor;
  }

 private:
  void join(TensorId a, TensorId b) { parent_[of(a)] = of(b); }

  std::vector<TensorId> parent_;
};

/// For each group the largest range of each channel, divided by the largest of all channels; 1 for
/// channels that are always 0. Empty where the scale must not change.
std::vector<Factors> factors_of_groups(const NetworkGraph& graph, const TensorGroups& groups,
                                       const Int8Calibration& calibration) {
  std::vector<Factors> factors(graph.tensors.size());
  for (TensorId tensor = 0; tensor < graph.tensors.size(); ++tensor) {
    const auto known = calibration.range_of_channels.find(graph.tensors[tensor].name);
    if (known == calibration.range_of_channels.end()) continue;
    Factors& of_group = factors[groups.of(tensor)];
    of_group.resize(known->second.size(), 0.0F);
    std::ranges::transform(of_group, known->second, of_group.begin(),
                           [](float a, float b) { return std::max(a, b); });
  }
  factors[groups.of(graph.input)].clear();
  factors[groups.of(graph.output)].clear();
  for (Factors& of_group : factors) {
    const float largest = of_group.empty() ? 0.0F : std::ranges::max(of_group);
    for (float& factor : of_group) factor = factor > 0.0F ? factor / largest : 1.0F;
  }
  return factors;
}

void divide_outputs(Convolution& c, const Factors& factors) {
  if (factors.empty()) return;
  const std::size_t per_output = c.weights.size() / c.bias.size();
  for (std::size_t o = 0; o < c.bias.size(); ++o) c.bias[o] /= factors[o % factors.size()];
  for (std::size_t i = 0; i < c.weights.size(); ++i) {
    c.weights[i] /= factors[i / per_output % factors.size()];
  }
}

void multiply_inputs(Convolution& c, const Factors& factors) {
  if (factors.empty()) return;
  const auto taps = static_cast<std::size_t>(c.kernel.rows * c.kernel.columns);
  for (std::size_t i = 0; i < c.weights.size(); ++i) {
    c.weights[i] *= factors[i / taps % factors.size()];
  }
}

}  // namespace

std::string crc32_of(const std::filesystem::path& file) {
  std::ifstream in(file, std::ios::binary);
  if (!in) return {};
  std::array<char, 65536> bytes{};
  uLong crc = crc32(0, nullptr, 0);
  while (in.read(bytes.data(), bytes.size()) || in.gcount() > 0)
    crc = crc32(crc, reinterpret_cast<const Bytef*>(bytes.data()), static_cast<uInt>(in.gcount()));
  std::ostringstream text;
  text << std::hex << std::setw(8) << std::setfill('0') << crc;
  return text.str();
}

std::string float_layer_fault(std::span<const std::string> layers,
                              const Int8Calibration& calibration) {
  for (const std::string& name : calibration.float_layers)
    if (std::ranges::find(layers, name) == layers.end())
      return "float_layers: '" + name + "' is no layer of the network";
  return {};
}

std::string calibration_fault(const NetworkGraph& graph, const Int8Calibration& calibration) {
  for (const Tensor& tensor : graph.tensors) {
    const auto known = calibration.range_of_channels.find(tensor.name);
    if (known == calibration.range_of_channels.end()) continue;
    const std::vector<float>& ranges = known->second;
    const auto channels = static_cast<std::size_t>(tensor.shape.channels);
    const std::string entry = "ranges: '" + tensor.name + "' has ";
    if (ranges.size() != channels)
      return entry + std::to_string(ranges.size()) + " numbers, and the tensor " +
             std::to_string(channels) + " channels";
    if (std::ranges::all_of(ranges, [](float range) { return range <= 0.0F; }))
      return entry + std::to_string(channels) + " zeros: no scan could be segmented with them";
  }
  return {};
}

Int8Calibration equalise_channels(NetworkGraph& graph, const Int8Calibration& calibration) {
  const TensorGroups groups(graph);
  const std::vector<Factors> factors = factors_of_groups(graph, groups, calibration);
  for (Layer& layer : graph.layers) {
    auto* const c = std::get_if<Convolution>(&layer.operation);
    if (c == nullptr) continue;
    multiply_inputs(*c, factors[groups.of(layer.inputs.front())]);
    divide_outputs(*c, factors[groups.of(layer.output)]);
  }
  Int8Calibration equalised = calibration;
  for (TensorId tensor = 0; tensor < graph.tensors.size(); ++tensor) {
    const auto known = equalised.range_of_channels.find(graph.tensors[tensor].name);
    const Factors& of_group = factors[groups.of(tensor)];
    if (known == equalised.range_of_channels.end() || of_group.empty()) continue;
    std::ranges::transform(known->second, of_group, known->second.begin(), std::divides());
  }
  return equalised;
}

}  // namespace stillmap
