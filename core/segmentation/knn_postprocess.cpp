#include "core/segmentation/knn_postprocess.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <span>
#include <sstream>
#include <type_traits>

namespace stillmap {
namespace {

/// Range of an empty pixel: beyond all points and any cutoff.
constexpr float empty_range_m = 1e30F;

struct Decision {
  SemanticClass label = SemanticClass::unlabeled;
  float confidence = 0.0F;
};

/// 1 - Gaussian over the window, which is normalised to sum 1.
std::vector<float> distance_factors(const KnnConfig& config) {
  const double middle = (config.window - 1) / 2.0;
  std::vector<double> gaussian;
  double sum = 0.0;
  for (int row = 0; row < config.window; ++row) {
    for (int column = 0; column < config.window; ++column) {
      const double squared = std::pow(row - middle, 2) + std::pow(column - middle, 2);
      gaussian.push_back(std::exp(-squared / (2.0 * config.sigma * config.sigma)));
      sum += gaussian.back();
    }
  }
  std::vector<float> factors;
  for (const double value : gaussian) factors.push_back(static_cast<float>(1.0 - value / sum));
  return factors;
}

/// A range image with a border of half a window, of range 0 and no class as in the reference, so
/// that windows need no bounds checks.
class PaddedImage {
 public:
  PaddedImage(const RangeImage& image, const PixelLabels& pixels, int half)
      : half_(static_cast<std::size_t>(half)),
        image_columns_(static_cast<std::size_t>(image.columns())),
        columns_(image_columns_ + 2 * half_) {
    const auto rows = static_cast<std::size_t>(image.rows());
    const std::size_t size = columns_ * (rows + 2 * half_);
    range_m_.assign(size, 0.0F);
    labels_.assign(size, SemanticClass::unlabeled);
    confidence_.assign(size, 0.0F);
    for (std::size_t row = 0; row < rows; ++row) copy_row(image, pixels, row);
  }

  [[nodiscard]] std::size_t columns() const { return columns_; }
  /// Upper left corner of the window around a pixel of the image.
  [[nodiscard]] std::size_t corner(std::size_t pixel) const {
    return pixel / image_columns_ * columns_ + pixel % image_columns_;
  }
  /// `empty_range_m` in empty pixels.
  [[nodiscard]] const float* range_m() const { return range_m_.data(); }
  [[nodiscard]] SemanticClass label(std::size_t index) const { return labels_[index]; }
  [[nodiscard]] float confidence(std::size_t index) const { return confidence_[index]; }

 private:
  void copy_row(const RangeImage& image, const PixelLabels& pixels, std::size_t row) {
    const std::size_t from = row * image_columns_;
    const std::size_t to = (row + half_) * columns_ + half_;
    for (std::size_t i = 0; i < image_columns_; ++i) {
      const float range_m = image.range_m()[from + i];
      range_m_[to + i] = range_m < 0.0F ? empty_range_m : range_m;
      labels_[to + i] = pixels.classes[from + i];
      confidence_[to + i] = pixels.confidence[from + i];
    }
  }

  std::size_t half_, image_columns_, columns_;
  std::vector<float> range_m_;
  std::vector<SemanticClass> labels_;
  std::vector<float> confidence_;
};

/// Points that are processed together in vector registers; loops over arrays would go through
/// memory.
constexpr std::size_t lanes = 4;
using Floats = float __attribute__((vector_size(lanes * sizeof(float))));
using Words = std::uint64_t __attribute__((vector_size(lanes * sizeof(std::uint64_t))));
using Numbers = std::int32_t __attribute__((vector_size(lanes * sizeof(std::int32_t))));

/// Distance and index of a pixel in the window packed into one double, which sorts by distance and
/// then by index: the mantissa of a float leaves 29 bits of a double's free.
using Keys = double __attribute__((vector_size(lanes * sizeof(double))));
constexpr std::uint64_t pixel_bits = 0xFFFF;
static_assert(KnnConfig::max_window * KnnConfig::max_window <= pixel_bits);
/// Added to every key: one step of the exponent. Without it distance 0 gives denormal numbers,
/// which are all zero to a processor that was told to treat them so (DAZ).
constexpr std::uint64_t exponent_step = std::uint64_t{1} << 52U;

Keys keys_of(Floats distance_m, std::uint64_t pixel) {
  const Words bits = std::bit_cast<Words>(__builtin_convertvector(distance_m, Keys));
  return std::bit_cast<Keys>((bits + exponent_step) | pixel);
}

/// For each lane the pixels nearest in range, in ascending order of distance, then of index.
template <std::size_t kept_pixels>
class NearestPixels {
 public:
  NearestPixels() { kept_.fill(keys_of(Floats{} + empty_range_m, 0)); }

  /// Inserts a pixel of each point's window.
  void add(Keys keys) {
    // Insertion without branches: entry k becomes the median of entry k - 1, entry k and the key.
    // No entry depends on another one's result.
    for (std::size_t k = kept_pixels - 1; k > 0; --k) {
      const Keys after_previous = kept_[k - 1] > keys ? kept_[k - 1] : keys;
      kept_[k] = after_previous < kept_[k] ? after_previous : kept_[k];
    }
    kept_[0] = keys < kept_[0] ? keys : kept_[0];
  }

  [[nodiscard]] float distance_m(std::size_t k, std::size_t p) const {
    return static_cast<float>(std::bit_cast<double>((bits(k, p) & ~pixel_bits) - exponent_step));
  }
  [[nodiscard]] std::size_t pixel(std::size_t k, std::size_t p) const {
    return bits(k, p) & pixel_bits;
  }

 private:
  [[nodiscard]] std::uint64_t bits(std::size_t k, std::size_t p) const {
    return std::bit_cast<std::uint64_t>(static_cast<double>(kept_[k][p]));
  }

  std::array<Keys, kept_pixels> kept_;
};

/// The class with most votes, the lowest of several; `unlabeled` when there is no vote for another.
SemanticClass majority_class(std::span<const SemanticClass> voted) {
  SemanticClass winner = SemanticClass::unlabeled;
  std::ptrdiff_t most = 0;
  for (std::size_t i = 0; i < voted.size(); ++i) {
    const SemanticClass label = voted[i];
    if (label == SemanticClass::unlabeled || label == winner) continue;
    const std::ptrdiff_t count = std::count(voted.begin(), voted.end(), label);
    if (count > most || (count == most && label < winner)) {
      winner = label;
      most = count;
    }
    if (2 * most > std::ssize(voted)) break;
  }
  return winner;
}

/// The vote of the pixels around each point.
class NeighbourVote {
 public:
  NeighbourVote(const RangeImage& image, const PixelLabels& pixels, const KnnConfig& config)
      : image_(image),
        pixels_(pixels),
        config_(config),
        padded_(image, pixels, config.window / 2),
        factors_(distance_factors(config)) {
    const auto window = static_cast<std::size_t>(config.window);
    for (std::size_t row = 0; row < window; ++row) {
      for (std::size_t i = 0; i < window; ++i) offsets_.push_back(row * padded_.columns() + i);
    }
    // In its own pixel the point counts itself, even if a nearer point hides it there.
    factors_[factors_.size() / 2] = 0.0F;
  }

  /// Sets the labels of up to `lanes` points from `first` on. `kept_pixels` is at least the number
  /// of neighbours.
  template <std::size_t kept_pixels>
  void decide(std::size_t first, PointLabels& labels) const {
    const std::size_t count = std::min(lanes, image_.point_count() - first);
    Numbers corner{};
    Floats range_m{};
    for (std::size_t p = 0; p < count; ++p) {
      const std::int32_t pixel = image_.pixel_of_point()[first + p];
      if (pixel == RangeImage::none) continue;
      corner[p] = static_cast<std::int32_t>(padded_.corner(static_cast<std::size_t>(pixel)));
      range_m[p] = image_.range_of_point_m()[first + p];
    }
    const auto nearest = find_nearest<kept_pixels>(corner, range_m);
    for (std::size_t p = 0; p < count; ++p) {
      const Decision decision = decide_one(nearest, p, static_cast<std::size_t>(corner[p]),
                                           image_.pixel_of_point()[first + p]);
      labels.classes[first + p] = decision.label;
      labels.confidence[first + p] = decision.confidence;
    }
  }

 private:
  template <std::size_t kept_pixels>
  [[nodiscard]] NearestPixels<kept_pixels> find_nearest(Numbers corner, Floats range_m) const {
    NearestPixels<kept_pixels> nearest;
    for (std::size_t i = 0; i < offsets_.size(); ++i) {
      const float* const ranges_m = padded_.range_m() + offsets_[i];
      Floats difference_m;
      for (std::size_t p = 0; p < lanes; ++p) difference_m[p] = ranges_m[corner[p]] - range_m[p];
      const Floats distance_m = difference_m < 0.0F ? -difference_m : difference_m;
      nearest.add(keys_of(distance_m * factors_[i], i));
    }
    return nearest;
  }

  template <class Nearest>
  [[nodiscard]] Decision decide_one(const Nearest& nearest, std::size_t p, std::size_t corner,
                                    std::int32_t pixel) const {
    if (pixel == RangeImage::none) return {};
    const Decision decision = count_votes(nearest, p, corner);
    if (decision.label != SemanticClass::unlabeled) return decision;
    if (config_.car_without_votes) return {.label = SemanticClass::car};
    const auto own = static_cast<std::size_t>(pixel);
    return {.label = pixels_.classes[own], .confidence = pixels_.confidence[own]};
  }

  template <class Nearest>
  [[nodiscard]] Decision count_votes(const Nearest& nearest, std::size_t p,
                                     std::size_t corner) const {
    std::array<SemanticClass, KnnConfig::max_neighbours> voted{};
    const auto wanted = static_cast<std::size_t>(config_.neighbours);
    const auto cutoff_m = static_cast<float>(config_.cutoff_m);
    std::size_t votes = 0;
    for (; votes < wanted && nearest.distance_m(votes, p) <= cutoff_m; ++votes) {
      voted[votes] = padded_.label(corner + offsets_[nearest.pixel(votes, p)]);
    }
    const SemanticClass winner = majority_class(std::span(voted).first(votes));
    if (winner == SemanticClass::unlabeled) return {};
    float confidence = 0.0F;
    for (std::size_t k = 0; k < votes; ++k) {
      if (voted[k] != winner) continue;
      confidence += padded_.confidence(corner + offsets_[nearest.pixel(k, p)]);
    }
    return {.label = winner, .confidence = confidence / static_cast<float>(votes)};
  }

  const RangeImage& image_;
  const PixelLabels& pixels_;
  const KnnConfig& config_;
  PaddedImage padded_;
  std::vector<float> factors_;
  /// Offset of each pixel of the window from its corner.
  std::vector<std::size_t> offsets_;
};

}  // namespace

std::string KnnConfig::faults() const {
  std::ostringstream faults;
  if (window < 1 || window > max_window || window % 2 == 0) {
    faults << "window = " << window << "; must be odd and 1.." << max_window << '\n';
  }
  if (neighbours < 1 || neighbours > max_neighbours) {
    faults << "neighbours = " << neighbours << "; must be 1.." << max_neighbours << '\n';
  }
  if (!(sigma > 0.0 && std::isfinite(sigma))) {
    faults << "sigma = " << sigma << "; must be above 0\n";
  }
  if (!(cutoff_m > 0.0 && std::isfinite(cutoff_m))) {
    faults << "cutoff_m = " << cutoff_m << "; must be above 0\n";
  }
  return faults.str();
}

PointLabels knn_labels(const RangeImage& image, const PixelLabels& pixels,
                       const KnnConfig& config) {
  assert(config.faults().empty());
  assert(pixels.classes.size() == image.pixel_count());
  const NeighbourVote vote(image, pixels, config);
  PointLabels labels;
  labels.classes.resize(image.point_count());
  labels.confidence.resize(image.point_count());
  const auto decide_all = [&]<std::size_t kept_pixels>(
                              std::integral_constant<std::size_t, kept_pixels>) {
    const tbb::blocked_range<std::size_t> all(0, (image.point_count() + lanes - 1) / lanes, 512);
    tbb::parallel_for(all, [&](const auto& some) {
      for (std::size_t i = some.begin(); i < some.end(); ++i) {
        vote.decide<kept_pixels>(i * lanes, labels);
      }
    });
  };
  // With the usual number of neighbours the nearest pixels stay in registers.
  constexpr std::integral_constant<std::size_t, 5> usual;
  constexpr std::integral_constant<std::size_t, KnnConfig::max_neighbours> all;
  if (config.neighbours <= static_cast<int>(usual)) {
    decide_all(usual);
  } else {
    decide_all(all);
  }
  return labels;
}

}  // namespace stillmap
