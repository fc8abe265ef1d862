#include "core/segmentation/pixel_scores.hpp"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <vector>

namespace stillmap {
namespace {

// Wide enough for a soft-max computed in half precision.
constexpr float sum_tolerance = 1e-2F;

}  // namespace

ScoreKind score_kind(std::span<const float> scores, std::size_t outputs) {
  assert(outputs > 0 && scores.size() % outputs == 0);
  const std::size_t pixels = scores.size() / outputs;
  std::vector<float> sums(pixels, 0.0F);
  for (std::size_t i = 0; i < scores.size(); ++i) {
    if (!(scores[i] >= 0.0F && scores[i] <= 1.0F + sum_tolerance)) return ScoreKind::logits;
    sums[i % pixels] += scores[i];
  }
  const bool all_one =
      std::ranges::all_of(sums, [](float sum) { return std::abs(sum - 1.0F) <= sum_tolerance; });
  return all_one ? ScoreKind::probabilities : ScoreKind::logits;
}

PixelOutputs most_probable(std::span<const float> scores, std::size_t outputs, ScoreKind kind) {
  assert(outputs > 0 && outputs <= PixelOutputs::max_outputs && scores.size() % outputs == 0);
  const std::size_t pixels = scores.size() / outputs;
  PixelOutputs result{.output = std::vector<std::uint8_t>(pixels, PixelOutputs::no_output),
                      .confidence = std::vector<float>(pixels, 0.0F)};
  std::vector<float> best(pixels, -std::numeric_limits<float>::infinity());
  // Class by class and not pixel by pixel: the scores lie in memory that way.
  for (std::size_t n = 0; n < outputs; ++n) {
    const std::span<const float> plane = scores.subspan(n * pixels, pixels);
    for (std::size_t i = 0; i < pixels; ++i) {
      if (!(plane[i] > best[i])) continue;
      best[i] = plane[i];
      result.output[i] = static_cast<std::uint8_t>(n);
    }
  }
  std::vector<float> sum(pixels, 0.0F);
  for (std::size_t n = 0; n < outputs; ++n) {
    const std::span<const float> plane = scores.subspan(n * pixels, pixels);
    for (std::size_t i = 0; i < pixels; ++i) {
      sum[i] += kind == ScoreKind::logits ? std::exp(plane[i] - best[i]) : plane[i];
    }
  }
  for (std::size_t i = 0; i < pixels; ++i) {
    // One NaN or infinite score spoils the sum, and the pixel says nothing.
    if (!std::isfinite(sum[i])) {
      result.output[i] = PixelOutputs::no_output;
    } else {
      result.confidence[i] =
          kind == ScoreKind::logits ? 1.0F / sum[i] : std::clamp(best[i], 0.0F, 1.0F);
    }
  }
  return result;
}

}  // namespace stillmap
