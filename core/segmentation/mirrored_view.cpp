#include "core/segmentation/mirrored_view.hpp"

#include <cassert>

#include "core/segmentation/pixel_scores.hpp"

namespace stillmap {

std::vector<float> mirrored(std::span<const float> input, std::size_t columns,
                            const InputStatistics& statistics) {
  assert(columns > 0 && input.size() % (columns * statistics.channels) == 0);
  const std::size_t pixels = input.size() / statistics.channels;
  std::vector<float> image(input.size());
  for (std::size_t first = 0; first < input.size(); first += columns) {
    for (std::size_t k = 0; k < columns; ++k) image[first + k] = input[first + columns - 1 - k];
  }
  // -y, normalised as y is. Pixels without a point are 0 in all channels.
  constexpr std::size_t y = index(InputChannel::y);
  const float twice_mean = 2.0F * statistics.mean[y] / statistics.deviation[y];
  for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
    bool has_point = false;
    for (std::size_t c = 0; c < statistics.channels; ++c)
      has_point = has_point || image[c * pixels + pixel] != 0.0F;
    float& value = image[y * pixels + pixel];
    if (has_point) value = -value - twice_mean;
  }
  return image;
}

PixelOutputs run_mirrored_too(SegmentationNetwork& network, std::span<const float> input,
                              std::size_t columns, const InputStatistics& statistics) {
  std::vector<float> mean = network.probabilities(input);
  const std::vector<float> other = network.probabilities(mirrored(input, columns, statistics));
  assert(mean.size() == other.size() && mean.size() % columns == 0);
  for (std::size_t first = 0; first < mean.size(); first += columns) {
    for (std::size_t k = 0; k < columns; ++k) {
      float& probability = mean[first + k];
      probability = 0.5F * (probability + other[first + columns - 1 - k]);
    }
  }
  const std::size_t pixels = input.size() / statistics.channels;
  return argmax_outputs(mean, mean.size() / pixels, ScoreKind::probabilities);
}

}  // namespace stillmap
