#include "core/segmentation/knn_postprocess.hpp"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <span>
#include <sstream>

namespace stillmap {
namespace {

struct Vote {
  float distance_m;
  float confidence;
  SemanticClass label;
};

/// The nearest few of the votes added, in rising order of distance.
class NearestVotes {
 public:
  explicit NearestVotes(int capacity) : capacity_(static_cast<std::size_t>(capacity)) {}

  void add(const Vote& vote) {
    if (count_ == capacity_ && !(vote.distance_m < votes_[count_ - 1].distance_m)) return;
    std::size_t place = count_ < capacity_ ? count_++ : count_ - 1;
    for (; place > 0 && vote.distance_m < votes_[place - 1].distance_m; --place) {
      votes_[place] = votes_[place - 1];
    }
    votes_[place] = vote;
  }

  [[nodiscard]] std::span<const Vote> votes() const { return {votes_.data(), count_}; }

 private:
  std::array<Vote, KnnConfig::max_neighbours> votes_;
  std::size_t capacity_;
  std::size_t count_ = 0;
};

struct Decision {
  SemanticClass label = SemanticClass::unlabeled;
  float confidence = 0.0F;
};

Decision count(std::span<const Vote> votes) {
  std::array<int, semantic_class_count> histogram{};
  for (const Vote& vote : votes) ++histogram[static_cast<std::size_t>(vote.label)];
  histogram[0] = 0;  // unlabeled
  const auto winner = std::ranges::max_element(histogram);
  if (*winner == 0) return {};
  Decision decision{.label = static_cast<SemanticClass>(winner - histogram.begin())};
  for (const Vote& vote : votes) {
    if (vote.label == decision.label) decision.confidence += vote.confidence;
  }
  decision.confidence /= static_cast<float>(votes.size());
  return decision;
}

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

class Poll {
 public:
  Poll(const RangeImage& image, const PixelLabels& pixels, const KnnConfig& config)
      : image_(image), pixels_(pixels), config_(config), factors_(distance_factors(config)) {}

  [[nodiscard]] Decision decide(std::size_t point) const {
    const std::int32_t pixel = image_.pixel_of_point()[point];
    if (pixel == RangeImage::none) return {};
    const NearestVotes nearest = ask_window(pixel, image_.range_of_point_m()[point]);
    const Decision decision = count(nearest.votes());
    if (decision.label != SemanticClass::unlabeled) return decision;
    if (config_.car_without_votes) return {.label = SemanticClass::car};
    const auto own = static_cast<std::size_t>(pixel);
    return {.label = pixels_.classes[own], .confidence = pixels_.confidence[own]};
  }

 private:
  [[nodiscard]] NearestVotes ask_window(std::int32_t pixel, float range_m) const {
    const int half = config_.window / 2;
    const int row = pixel / image_.columns();
    const int column = pixel % image_.columns();
    NearestVotes nearest(config_.neighbours);
    std::size_t place = 0;
    for (int r = row - half; r <= row + half; ++r) {
      for (int c = column - half; c <= column + half; ++c, ++place) {
        Vote vote = pixel_vote(r, c);
        // The point stands for itself in its own pixel, where a nearer one may hide it.
        const bool own = r == row && c == column;
        if (vote.distance_m < 0.0F) continue;
        vote.distance_m = own ? 0.0F : std::abs(vote.distance_m - range_m) * factors_[place];
        if (vote.distance_m <= static_cast<float>(config_.cutoff_m)) nearest.add(vote);
      }
    }
    return nearest;
  }

  /// A pixel's range, class and confidence. Beyond the image's edge the reference sees range 0 and
  /// no class.
  [[nodiscard]] Vote pixel_vote(int row, int column) const {
    if (row < 0 || row >= image_.rows() || column < 0 || column >= image_.columns()) {
      return {.distance_m = 0.0F, .confidence = 0.0F, .label = SemanticClass::unlabeled};
    }
    const std::size_t pixel = image_.pixel(row, column);
    return {.distance_m = image_.range_m()[pixel],
            .confidence = pixels_.confidence[pixel],
            .label = pixels_.classes[pixel]};
  }

  const RangeImage& image_;
  const PixelLabels& pixels_;
  const KnnConfig& config_;
  std::vector<float> factors_;
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
  const tbb::blocked_range<std::size_t> all(0, image.point_count(), 2048);
  tbb::parallel_for(all, [&](const auto& some) {
    for (std::size_t i = some.begin(); i < some.end(); ++i) {
      const Decision decision = poll.decide(i);
      labels.classes[i] = decision.label;
      labels.confidence[i] = decision.confidence;
    }
  });
  return labels;
}

}  // namespace stillmap
