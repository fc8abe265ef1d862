#include "core/segmentation/knn_postprocess.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdint>
#include <limits>
#include <sstream>

namespace stillmap {
namespace {

struct Decision {
  SemanticClass label = SemanticClass::unlabeled;
  float confidence = 0.0F;
};

/// 1 - Gaussian of unit sum, over the window.
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

/// A range image with half a window of what the reference sees beyond its edge, range 0 and no
/// class, all round it, so that no window needs to know where the edge is.
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
  /// Upper left corner of the window round a pixel of the image.
  [[nodiscard]] std::size_t corner(std::size_t pixel) const {
    return pixel / image_columns_ * columns_ + pixel % image_columns_;
  }
  /// Infinite where no point is.
  [[nodiscard]] const float* range_m() const { return range_m_.data(); }
  [[nodiscard]] SemanticClass label(std::size_t place) const { return labels_[place]; }
  [[nodiscard]] float confidence(std::size_t place) const { return confidence_[place]; }

 private:
  void copy_row(const RangeImage& image, const PixelLabels& pixels, std::size_t row) {
    const std::size_t from = row * image_columns_;
    const std::size_t to = (row + half_) * columns_ + half_;
    for (std::size_t i = 0; i < image_columns_; ++i) {
      const float range_m = image.range_m()[from + i];
      range_m_[to + i] = range_m < 0.0F ? std::numeric_limits<float>::infinity() : range_m;
      labels_[to + i] = pixels.classes[from + i];
      confidence_[to + i] = pixels.confidence[from + i];
    }
  }

  std::size_t half_, image_columns_, columns_;
  std::vector<float> range_m_;
  std::vector<SemanticClass> labels_;
  std::vector<float> confidence_;
};

/// Points that are worked on at once. The compiler must be told to make vectors of loops over them.
constexpr std::size_t lanes = 16;
template <class T>
using Lanes = std::array<T, lanes>;

/// Of each of a few points the pixels nearest in range, in rising order of distance; equal ones in
/// the order in which they came.
class NearestPixels {
 public:
  explicit NearestPixels(int wanted) : wanted_(static_cast<std::size_t>(wanted)) {
    for (std::size_t k = 0; k < wanted_; ++k) {
      distance_m_[k].fill(std::numeric_limits<float>::infinity());
      place_[k].fill(0);
    }
  }

  /// A pixel of each point's window, by its number there. `distance_m` is used up.
  void add(Lanes<float>& distance_m, std::int32_t place) {
    Lanes<std::int32_t> moving, place_moving;
    moving.fill(0);
    place_moving.fill(place);
    for (std::size_t k = 0; k < wanted_; ++k) {
      Lanes<float>& kept_m = distance_m_[k];
      Lanes<std::int32_t>& kept_place = place_[k];
      // From the first that is farther all move one place on.
#pragma omp simd
      for (std::size_t p = 0; p < lanes; ++p) {
        const float old_m = kept_m[p];
        const std::int32_t old_place = kept_place[p];
        const bool move = (moving[p] | static_cast<std::int32_t>(distance_m[p] < old_m)) != 0;
        moving[p] = move ? 1 : 0;
        kept_m[p] = move ? distance_m[p] : old_m;
        kept_place[p] = move ? place_moving[p] : old_place;
        distance_m[p] = move ? old_m : distance_m[p];
        place_moving[p] = move ? old_place : place_moving[p];
      }
    }
  }

  [[nodiscard]] float distance_m(std::size_t k, std::size_t p) const { return distance_m_[k][p]; }
  [[nodiscard]] std::size_t place(std::size_t k, std::size_t p) const {
    return static_cast<std::size_t>(place_[k][p]);
  }

 private:
  std::array<Lanes<float>, KnnConfig::max_neighbours> distance_m_;
  std::array<Lanes<std::int32_t>, KnnConfig::max_neighbours> place_;
  std::size_t wanted_;
};

class Poll {
 public:
  Poll(const RangeImage& image, const PixelLabels& pixels, const KnnConfig& config)
      : image_(image),
        pixels_(pixels),
        config_(config),
        padded_(image, pixels, config.window / 2),
        factors_(distance_factors(config)) {
    const auto window = static_cast<std::size_t>(config.window);
    for (std::size_t row = 0; row < window; ++row) {
      for (std::size_t i = 0; i < window; ++i) offsets_.push_back(row * padded_.columns() + i);
    }
    // The point stands for itself in its own pixel, where a nearer one may hide it.
    factors_[factors_.size() / 2] = 0.0F;
  }

  /// Decides about the points from `first` on, at most as many as there are lanes.
  void decide(std::size_t first, PointLabels& labels) const {
    const std::size_t count = std::min(lanes, image_.point_count() - first);
    Lanes<std::int32_t> corner{};
    Lanes<float> range_m{};
    for (std::size_t p = 0; p < count; ++p) {
      const std::int32_t pixel = image_.pixel_of_point()[first + p];
      if (pixel == RangeImage::none) continue;
      corner[p] = static_cast<std::int32_t>(padded_.corner(static_cast<std::size_t>(pixel)));
      range_m[p] = image_.range_of_point_m()[first + p];
    }
    const NearestPixels nearest = ask(corner, range_m);
    for (std::size_t p = 0; p < count; ++p) {
      const Decision decision = decide_one(nearest, p, static_cast<std::size_t>(corner[p]),
                                           image_.pixel_of_point()[first + p]);
      labels.classes[first + p] = decision.label;
      labels.confidence[first + p] = decision.confidence;
    }
  }

 private:
  [[nodiscard]] NearestPixels ask(const Lanes<std::int32_t>& corner,
                                  const Lanes<float>& range_m) const {
    NearestPixels nearest(config_.neighbours);
    for (std::size_t i = 0; i < offsets_.size(); ++i) {
      const float* const ranges_m = padded_.range_m() + offsets_[i];
      const float factor = factors_[i];
      Lanes<float> distance_m;
#pragma omp simd
      for (std::size_t p = 0; p < lanes; ++p) {
        distance_m[p] = std::abs(ranges_m[corner[p]] - range_m[p]) * factor;
      }
      nearest.add(distance_m, static_cast<std::int32_t>(i));
    }
    return nearest;
  }

  [[nodiscard]] Decision decide_one(const NearestPixels& nearest, std::size_t p, std::size_t corner,
                                    std::int32_t pixel) const {
    if (pixel == RangeImage::none) return {};
    const Decision decision = count_votes(nearest, p, corner);
    if (decision.label != SemanticClass::unlabeled) return decision;
    if (config_.car_without_votes) return {.label = SemanticClass::car};
    const auto own = static_cast<std::size_t>(pixel);
    return {.label = pixels_.classes[own], .confidence = pixels_.confidence[own]};
  }

  [[nodiscard]] Decision count_votes(const NearestPixels& nearest, std::size_t p,
                                     std::size_t corner) const {
    struct Tally {
      int votes = 0;
      float confidence = 0.0F;
    };
    std::array<Tally, semantic_class_count> tallies{};
    const auto wanted = static_cast<std::size_t>(config_.neighbours);
    const auto cutoff_m = static_cast<float>(config_.cutoff_m);
    std::size_t votes = 0;
    for (; votes < wanted && nearest.distance_m(votes, p) <= cutoff_m; ++votes) {
      const std::size_t place = corner + offsets_[nearest.place(votes, p)];
      Tally& tally = tallies[static_cast<std::size_t>(padded_.label(place))];
      ++tally.votes;
      tally.confidence += padded_.confidence(place);
    }
    tallies[0] = {};  // unlabeled
    const auto winner = std::ranges::max_element(tallies, {}, &Tally::votes);
    if (winner->votes == 0) return {};
    return {.label = static_cast<SemanticClass>(winner - tallies.begin()),
            .confidence = winner->confidence / static_cast<float>(votes)};
  }

  const RangeImage& image_;
  const PixelLabels& pixels_;
  const KnnConfig& config_;
  PaddedImage padded_;
  std::vector<float> factors_;
  /// Of each pixel of the window, from its corner.
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
  const Poll poll(image, pixels, config);
  PointLabels labels;
  labels.classes.resize(image.point_count());
  labels.confidence.resize(image.point_count());
  const tbb::blocked_range<std::size_t> all(0, (image.point_count() + lanes - 1) / lanes, 128);
  tbb::parallel_for(all, [&](const auto& some) {
    for (std::size_t i = some.begin(); i < some.end(); ++i) poll.decide(i * lanes, labels);
  });
  return labels;
}

}  // namespace stillmap
