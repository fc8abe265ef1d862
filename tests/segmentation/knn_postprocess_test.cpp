#include "core/segmentation/knn_postprocess.hpp"

#include <gtest/gtest.h>
#ifdef __SSE3__
#include <pmmintrin.h>
#endif

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>

#include "tests/segmentation/sample_model.hpp"

namespace stillmap {
namespace {

constexpr int image_rows = 8;
constexpr int image_columns = 32;
constexpr std::size_t invalid = 20;

const ModelDescription model = test::describe(test::random_network(image_rows, image_columns, 3));

struct Neighbour {
  float distance_m;
  std::size_t label;
  float confidence;
};

/// 1 - normalised Gaussian, row by row.
std::vector<float> knn_weights(const KnnConfig& config) {
  const int half = config.window / 2;
  std::vector<double> gaussian;
  for (int r = -half; r <= half; ++r) {
    for (int c = -half; c <= half; ++c) {
      gaussian.push_back(std::exp(-(r * r + c * c) / (2.0 * config.sigma * config.sigma)));
    }
  }
  const double sum = std::accumulate(gaussian.begin(), gaussian.end(), 0.0);
  std::vector<float> weights;
  for (const double value : gaussian) weights.push_back(static_cast<float>(1.0 - value / sum));
  return weights;
}

/// The whole window of a point as lidar-bonnetal unfolds it: zeros beyond the edge, infinity for
/// empty pixels, the point itself in the middle; sorted, the nearest first.
std::vector<Neighbour> sorted_window(const RangeImage& image, const PixelLabels& pixels,
                                     std::size_t point, const KnnConfig& config) {
  const int pixel = image.pixel_of_point()[point];
  const float own_range = image.range_of_point_m()[point];
  const int half = config.window / 2;
  const std::vector<float> weight = knn_weights(config);
  std::vector<Neighbour> window;
  for (int r = 0; r < config.window; ++r) {
    for (int c = 0; c < config.window; ++c) {
      const int row = pixel / image_columns + r - half;
      const int column = pixel % image_columns + c - half;
      const bool inside = row >= 0 && row < image_rows && column >= 0 && column < image_columns;
      const std::size_t at = inside ? image.pixel(row, column) : 0;
      float range = inside ? image.range_m()[at] : 0.0F;
      if (range < 0.0F) range = std::numeric_limits<float>::infinity();
      if (r == half && c == half) range = own_range;
      window.push_back({std::abs(range - own_range) * weight[window.size()],
                        inside ? static_cast<std::size_t>(pixels.classes[at]) : 0,
                        inside ? pixels.confidence[at] : 0.0F});
    }
  }
  std::ranges::stable_sort(window, {}, &Neighbour::distance_m);
  return window;
}

struct ExpectedVote {
  std::size_t label;
  float confidence;
};

ExpectedVote reference(const RangeImage& image, const PixelLabels& pixels, std::size_t point,
                       const KnnConfig& config) {
  std::vector<Neighbour> window = sorted_window(image, pixels, point, config);
  window.resize(static_cast<std::size_t>(config.neighbours));
  std::array<int, invalid + 1> histogram{};
  int valid = 0;
  for (Neighbour& neighbour : window) {
    if (neighbour.distance_m > static_cast<float>(config.cutoff_m)) neighbour.label = invalid;
    if (neighbour.label != invalid) ++valid;
    ++histogram[neighbour.label];
  }
  const auto winner = std::max_element(histogram.begin() + 1, histogram.begin() + invalid);
  const auto label = static_cast<std::size_t>(winner - histogram.begin());
  const auto own = static_cast<std::size_t>(image.pixel_of_point()[point]);
  if (*winner == 0 && !config.car_without_votes) {
    return {static_cast<std::size_t>(pixels.classes[own]), pixels.confidence[own]};
  }
  float sum = 0.0F;
  for (const Neighbour& neighbour : window) {
    if (neighbour.label == label) sum += neighbour.confidence;
  }
  return {label, *winner == 0 ? 0.0F : sum / static_cast<float>(valid)};
}

/// Random classes in patches, a good part unlabeled.
PixelLabels random_pixels(unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_int_distribution<int> label(-4, 19);
  std::uniform_real_distribution<float> share(0.0F, 1.0F);
  PixelLabels pixels;
  for (int i = 0; i < image_rows * image_columns; ++i) {
    pixels.classes.push_back(static_cast<SemanticClass>(std::max(0, label(random))));
    pixels.confidence.push_back(share(random));
  }
  return pixels;
}

void expect_like_reference(const KnnConfig& config) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    const Scan scan = test::random_scan(50 + seed * 100, seed);
    const RangeImage image = test::project(scan, model);
    const PixelLabels pixels = random_pixels(seed);
    const PointLabels labels = knn_labels(image, pixels, config);
    ASSERT_EQ(labels.classes.size(), scan.size());
    for (std::size_t i = 0; i < scan.size(); ++i) {
      const ExpectedVote expected = reference(image, pixels, i, config);
      EXPECT_EQ(static_cast<std::size_t>(labels.classes[i]), expected.label) << "point " << i;
      EXPECT_NEAR(labels.confidence[i], expected.confidence, 1e-6F) << "point " << i;
    }
  }
}

TEST(KnnPostprocess, EqualsAPlainReferenceOnRandomImages) { expect_like_reference({}); }

TEST(KnnPostprocess, EqualsThePlainReferenceWithOtherParameters) {
  expect_like_reference({.neighbours = 7, .window = 7, .sigma = 1.5, .cutoff_m = 2.0});
  expect_like_reference({.neighbours = 1, .window = 3, .sigma = 0.5, .cutoff_m = 0.2});
}

TEST(KnnPostprocess, EqualsThePlainReferenceWithItsQuirk) {
  expect_like_reference({.car_without_votes = true});
}

#ifdef __SSE3__
TEST(KnnPostprocess, EqualsThePlainReferenceWhereDenormalNumbersAreZero) {
  // Libraries may leave the processor so.
  const unsigned before = _mm_getcsr();
  _mm_setcsr(before | _MM_FLUSH_ZERO_ON | _MM_DENORMALS_ZERO_ON);
  expect_like_reference({.neighbours = 7, .window = 7, .sigma = 1.5, .cutoff_m = 2.0});
  expect_like_reference({});
  _mm_setcsr(before);
}
#endif

TEST(KnnPostprocess, GivesAHiddenPointTheClassOfItsSurroundings) {
  // A pole at 5 m, and a wall at 10 m of which one point lies behind the pole in its pixel.
  Scan scan;
  const float step = 2.0F * std::numbers::pi_v<float> / image_columns;
  for (int i = -4; i <= 4; ++i) {
    const float yaw = (static_cast<float>(i) + 0.5F) * step;
    scan.points_lidar.emplace_back(10.0F * std::cos(yaw), 10.0F * std::sin(yaw), 0.0F);
  }
  scan.points_lidar.push_back(0.5F * scan.points_lidar[4]);
  const RangeImage image = test::project(scan, model);
  PixelLabels pixels{.classes = std::vector(image.pixel_count(), SemanticClass::building),
                     .confidence = std::vector(image.pixel_count(), 0.5F)};
  pixels.classes[static_cast<std::size_t>(image.pixel_of_point()[9])] = SemanticClass::pole;
  const PointLabels labels = knn_labels(image, pixels, {});
  EXPECT_EQ(labels.classes[4], SemanticClass::building);
  EXPECT_EQ(labels.classes[9], SemanticClass::pole);
}

TEST(KnnPostprocess, LeavesPointsWithoutAPixelUnlabeled) {
  Scan scan;
  scan.points_lidar = {{0.0F, 0.0F, 0.0F}, {5.0F, 0.0F, 0.0F}};
  scan.points_lidar.emplace_back(std::numeric_limits<float>::quiet_NaN(), 1.0F, 0.0F);
  const RangeImage image = test::project(scan, model);
  const PixelLabels pixels{.classes = std::vector(image.pixel_count(), SemanticClass::road),
                           .confidence = std::vector(image.pixel_count(), 1.0F)};
  const PointLabels labels = knn_labels(image, pixels, {});
  EXPECT_EQ(labels.classes,
            (std::vector{SemanticClass::unlabeled, SemanticClass::road, SemanticClass::unlabeled}));
}

TEST(KnnConfig, NamesEveryFault) {
  EXPECT_TRUE(KnnConfig{}.faults().empty());
  const KnnConfig bad{.neighbours = 0, .window = 4, .sigma = -1.0, .cutoff_m = std::nan("")};
  for (const char* field : {"neighbours", "window", "sigma", "cutoff_m"}) {
    EXPECT_NE(bad.faults().find(field), std::string::npos) << field;
  }
}

}  // namespace
}  // namespace stillmap
