#include "core/segmentation/pixel_scores.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <vector>

namespace stillmap {
namespace {

// Three outputs x two pixels.
const std::vector<float> probabilities{0.2F, 0.1F, 0.7F, 0.3F, 0.1F, 0.6F};
const std::vector<float> logits{1.0F, -2.0F, 3.0F, 0.5F, -1.0F, 4.0F};

TEST(ScoreKind, IsProbabilitiesWhenEveryPixelSumsToOne) {
  EXPECT_EQ(score_kind(probabilities, 3), ScoreKind::probabilities);
}

TEST(ScoreKind, IsLogitsWhenScoresAreNegativeOrSumToSomethingElse) {
  EXPECT_EQ(score_kind(logits, 3), ScoreKind::logits);
  EXPECT_EQ(score_kind(std::vector<float>{0.5F, 0.5F, 0.9F, 0.5F}, 2), ScoreKind::logits);
}

TEST(ArgmaxOutputs, TakesTheLargestProbabilityAsItIs) {
  const PixelOutputs result = argmax_outputs(probabilities, 3, ScoreKind::probabilities);
  EXPECT_EQ(result.output, (std::vector<std::uint8_t>{1, 2}));
  EXPECT_FLOAT_EQ(result.confidence[0], 0.7F);
  EXPECT_FLOAT_EQ(result.confidence[1], 0.6F);
}

TEST(ArgmaxOutputs, AppliesTheSoftMaxToLogits) {
  std::mt19937 random(3);
  std::normal_distribution<float> score(0.0F, 5.0F);
  constexpr std::size_t outputs = 20;
  constexpr std::size_t pixels = 100;
  std::vector<float> scores(outputs * pixels);
  for (float& value : scores) value = score(random);
  const PixelOutputs result = argmax_outputs(scores, outputs, ScoreKind::logits);
  for (std::size_t i = 0; i < pixels; ++i) {
    double sum = 0.0;
    for (std::size_t n = 0; n < outputs; ++n) sum += std::exp(double{scores[n * pixels + i]});
    const float best = scores[result.output[i] * pixels + i];
    EXPECT_NEAR(result.confidence[i], std::exp(double{best}) / sum, 1e-5);
    for (std::size_t n = 0; n < outputs; ++n) EXPECT_LE(scores[n * pixels + i], best);
  }
}

/// The same scores, pixel by pixel.
std::vector<float> by_pixels(const std::vector<float>& planes, std::size_t outputs) {
  const std::size_t pixels = planes.size() / outputs;
  std::vector<float> turned(planes.size());
  for (std::size_t i = 0; i < planes.size(); ++i) {
    turned[i % pixels * outputs + i / pixels] = planes[i];
  }
  return turned;
}

TEST(ArgmaxOutputs, DoesNotCareHowScoresLieInMemory) {
  std::mt19937 random(4);
  std::normal_distribution<float> score(0.0F, 5.0F);
  for (const std::size_t outputs : {1UL, 3UL, 20UL, 255UL}) {
    std::vector<float> scores(outputs * 77);
    for (float& value : scores) value = score(random);
    const std::vector<float> turned = by_pixels(scores, outputs);
    const PixelOutputs a = argmax_outputs(scores, outputs, ScoreKind::logits);
    const PixelOutputs b = argmax_outputs(turned, outputs, ScoreKind::logits, ScoreLayout::pixels);
    EXPECT_EQ(a.output, b.output);
    EXPECT_EQ(a.confidence, b.confidence);
    EXPECT_EQ(probabilities_of(scores, outputs, ScoreKind::logits),
              probabilities_of(turned, outputs, ScoreKind::logits, ScoreLayout::pixels));
  }
}

TEST(ProbabilitiesOf, AreTheSoftMaxOfLogitsAndProbabilitiesAsTheyAre) {
  const std::vector<float> soft = probabilities_of(logits, 3, ScoreKind::logits);
  for (std::size_t p = 0; p < 2; ++p) {
    double sum = 0.0;
    for (std::size_t n = 0; n < 3; ++n) sum += std::exp(double{logits[2 * n + p]});
    for (std::size_t n = 0; n < 3; ++n) {
      EXPECT_NEAR(soft[2 * n + p], std::exp(double{logits[2 * n + p]}) / sum, 1e-6);
    }
  }
  EXPECT_EQ(probabilities_of(probabilities, 3, ScoreKind::probabilities), probabilities);
}

TEST(ArgmaxOutputs, SurvivesLogitsThatOverflowAnExponential) {
  const PixelOutputs result =
      argmax_outputs(std::vector<float>{1000.0F, 900.0F}, 2, ScoreKind::logits);
  EXPECT_EQ(result.output[0], 0);
  EXPECT_FLOAT_EQ(result.confidence[0], 1.0F);
}

TEST(ArgmaxOutputs, SaysNothingOfPixelsWithoutFiniteScores) {
  constexpr float nan = std::numeric_limits<float>::quiet_NaN();
  constexpr float infinity = std::numeric_limits<float>::infinity();
  const std::vector<float> scores{nan, 1.0F, infinity, 0.5F, 2.0F, 0.5F};
  for (const ScoreKind kind : {ScoreKind::logits, ScoreKind::probabilities}) {
    const PixelOutputs result = argmax_outputs(scores, 2, kind);
    EXPECT_EQ(result.output[0], PixelOutputs::no_output);
    EXPECT_EQ(result.output[2], PixelOutputs::no_output);
    EXPECT_EQ(result.confidence[0], 0.0F);
    EXPECT_EQ(result.output[1], 1);
  }
}

}  // namespace
}  // namespace stillmap
