#include "core/segmentation/pixel_scores.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <limits>

namespace stillmap {
namespace {

// Tolerates a soft-max computed in half precision.
constexpr float sum_tolerance = 1e-2F;

/// Pixels that are processed together. Loops over them need `omp simd`: the compiler would unroll
/// such short loops instead of vectorising them.
constexpr std::size_t lanes = 16;
template <class T>
using Lanes = std::array<T, lanes>;

/// exp(x) is taken as 0 below it.
constexpr float min_exponent = -87.0F;

/// exp(x) for min_exponent <= x <= 0 with a relative error of 2e-7, without branches: 2^n times
/// Cephes' polynomial.
inline float exp_of_negative(float x) {
  constexpr float log2_e = 1.44269504F, ln2_high = 0.693359375F, ln2_low = -2.12194440e-4F;
  const auto n = static_cast<std::int32_t>(x * log2_e - 0.5F);
  const auto whole = static_cast<float>(n);
  const float r = (x - whole * ln2_high) - whole * ln2_low;
  const float polynomial =
      (((((1.9875691500e-4F * r + 1.3981999507e-3F) * r + 8.3334519073e-3F) * r +
         4.1665795894e-2F) *
            r +
        1.6666665459e-1F) *
           r +
       5.0000001201e-1F) *
          r * r +
      r + 1.0F;
  return polynomial * std::bit_cast<float>((n + 127) << 23);
}

/// The scores of a few pixels, output by output.
class Tile {
 public:
  Tile(std::span<const float> scores, std::size_t outputs, ScoreLayout layout, std::size_t first)
      : outputs_(outputs), count_(std::min(lanes, scores.size() / outputs - first)) {
    const std::size_t pixels = scores.size() / outputs;
    const bool planes = layout == ScoreLayout::planes;
    const std::size_t output_step = planes ? pixels : 1;
    const std::size_t pixel_step = planes ? 1 : outputs;
    const float* const begin = scores.data() + first * pixel_step;
    for (std::size_t n = 0; n < outputs; ++n) {
      scores_[n].fill(0.0F);
      for (std::size_t p = 0; p < count_; ++p) {
        scores_[n][p] = begin[n * output_step + p * pixel_step];
      }
    }
    find_best();
  }

  [[nodiscard]] std::size_t count() const { return count_; }
  [[nodiscard]] std::uint8_t best_output(std::size_t p) const {
    return static_cast<std::uint8_t>(best_output_[p]);
  }
  [[nodiscard]] float best(std::size_t p) const { return best_[p]; }
  /// All scores are finite.
  [[nodiscard]] bool finite(std::size_t p) const { return finite_[p] != 0; }
  [[nodiscard]] float score(std::size_t n, std::size_t p) const { return scores_[n][p]; }

  /// Replaces each score by exp(score - best) and returns their sums.
  Lanes<float> exponentiate() {
    Lanes<float> sum{};
    for (std::size_t n = 0; n < outputs_; ++n) {
      // A loop of its own: otherwise the compiler emits a branch and does not vectorise.
#pragma omp simd
      for (std::size_t p = 0; p < lanes; ++p) {
        const float x = scores_[n][p] - best_[p];
        scores_[n][p] = x > min_exponent ? x : min_exponent;
      }
#pragma omp simd
      for (std::size_t p = 0; p < lanes; ++p) {
        scores_[n][p] = exp_of_negative(scores_[n][p]);
        sum[p] += scores_[n][p];
      }
    }
    return sum;
  }

 private:
  void find_best() {
    best_.fill(-std::numeric_limits<float>::infinity());
    best_output_.fill(PixelOutputs::no_output);
    finite_.fill(1);
    for (std::size_t n = 0; n < outputs_; ++n) {
#pragma omp simd
      for (std::size_t p = 0; p < lanes; ++p) {
        const float score = scores_[n][p];
        const bool better = score > best_[p];
        best_[p] = better ? score : best_[p];
        best_output_[p] = better ? static_cast<std::int32_t>(n) : best_output_[p];
        finite_[p] &= std::abs(score) <= std::numeric_limits<float>::max() ? 1 : 0;
      }
    }
  }

  std::array<Lanes<float>, PixelOutputs::max_outputs> scores_;
  Lanes<float> best_;
  Lanes<std::int32_t> best_output_;
  Lanes<std::int32_t> finite_;
  std::size_t outputs_;
  std::size_t count_;
};

/// Calls `work(tile, first pixel)` for all pixels, on all cores.
template <class Work>
void for_each_tile(std::span<const float> scores, std::size_t outputs, ScoreLayout layout,
                   const Work& work) {
  assert(outputs > 0 && outputs <= PixelOutputs::max_outputs && scores.size() % outputs == 0);
  const std::size_t pixels = scores.size() / outputs;
  const tbb::blocked_range<std::size_t> all(0, (pixels + lanes - 1) / lanes, 256);
  tbb::parallel_for(all, [&](const auto& some) {
    for (std::size_t i = some.begin(); i < some.end(); ++i) {
      Tile tile(scores, outputs, layout, i * lanes);
      work(tile, i * lanes);
    }
  });
}

}  // namespace

ScoreKind score_kind(std::span<const float> scores, std::size_t outputs, ScoreLayout layout) {
  assert(outputs > 0 && scores.size() % outputs == 0);
  const std::size_t pixels = scores.size() / outputs;
  std::vector<float> sums(pixels, 0.0F);
  for (std::size_t i = 0; i < scores.size(); ++i) {
    if (!(scores[i] >= 0.0F && scores[i] <= 1.0F + sum_tolerance)) return ScoreKind::logits;
    sums[layout == ScoreLayout::planes ? i % pixels : i / outputs] += scores[i];
  }
  const bool all_one =
      std::ranges::all_of(sums, [](float sum) { return std::abs(sum - 1.0F) <= sum_tolerance; });
  return all_one ? ScoreKind::probabilities : ScoreKind::logits;
}

PixelOutputs argmax_outputs(std::span<const float> scores, std::size_t outputs, ScoreKind kind,
                            ScoreLayout layout) {
  const std::size_t pixels = scores.size() / outputs;
  PixelOutputs result{.output = std::vector<std::uint8_t>(pixels, PixelOutputs::no_output),
                      .confidence = std::vector<float>(pixels, 0.0F)};
  for_each_tile(scores, outputs, layout, [&](Tile& tile, std::size_t first) {
    const bool logits = kind == ScoreKind::logits;
    const Lanes<float> sum = logits ? tile.exponentiate() : Lanes<float>{};
    for (std::size_t p = 0; p < tile.count(); ++p) {
      // A NaN or infinite score makes the whole pixel invalid.
      if (!tile.finite(p)) continue;
      result.output[first + p] = tile.best_output(p);
      result.confidence[first + p] = logits ? 1.0F / sum[p] : std::clamp(tile.best(p), 0.0F, 1.0F);
    }
  });
  return result;
}

std::vector<float> probabilities_of(std::span<const float> scores, std::size_t outputs,
                                    ScoreKind kind, ScoreLayout layout) {
  const std::size_t pixels = scores.size() / outputs;
  std::vector<float> result(scores.size());
  for_each_tile(scores, outputs, layout, [&](Tile& tile, std::size_t first) {
    Lanes<float> sum;
    sum.fill(1.0F);
    if (kind == ScoreKind::logits) sum = tile.exponentiate();
    for (std::size_t n = 0; n < outputs; ++n) {
      for (std::size_t p = 0; p < tile.count(); ++p) {
        result[n * pixels + first + p] =
            tile.finite(p) ? tile.score(n, p) / sum[p] : std::numeric_limits<float>::quiet_NaN();
      }
    }
  });
  return result;
}

}  // namespace stillmap
