#include "core/segmentation/network_input.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "core/segmentation/surface_slope.hpp"
#include "tests/segmentation/sample_model.hpp"

namespace stillmap {
namespace {

using test::describe;
using test::project;
using test::random_network;
using test::random_scan;

const ModelDescription model = describe(random_network(8, 32, 3));
constexpr std::size_t pixels = 8 * 32;

/// Value of `channel` of the point, not yet normalised.
float raw(const Scan& scan, std::size_t point, std::size_t channel) {
  if (channel == 0) return scan.points_lidar[point].norm();
  if (channel == 4) return scan.intensity[point];
  return scan.points_lidar[point][static_cast<Eigen::Index>(channel) - 1];
}

TEST(NetworkInput, IsTheNormalisedNearestPointAndZeroWhereNoneIs) {
  const Scan scan = random_scan(200, 1);
  const RangeImage image = project(scan, model);
  const std::vector<float> input = make_network_input(scan, image, model);
  ASSERT_EQ(input.size(), 5 * pixels);
  int empty = 0;
  for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
    const std::int32_t nearest = image.nearest()[pixel];
    empty += nearest == RangeImage::none ? 1 : 0;
    for (std::size_t c = 0; c < 5; ++c) {
      const float expected =
          nearest == RangeImage::none
              ? 0.0F
              : (raw(scan, static_cast<std::size_t>(nearest), c) - model.statistics.mean[c]) /
                    model.statistics.deviation[c];
      EXPECT_NEAR(input[c * pixels + pixel], expected, 1e-5F);
    }
  }
  EXPECT_GT(empty, 0);
}

TEST(NetworkInput, HasTheSlopeOfTheSurfaceForModelsThatTakeIt) {
  const Scan scan = random_scan(200, 1);
  const RangeImage image = project(scan, model);
  ModelDescription sloping = model;
  sloping.statistics.channels = 6;
  sloping.statistics.mean[5] = 0.5F;
  sloping.statistics.deviation[5] = 0.8F;
  const std::vector<float> plain = make_network_input(scan, image, model);
  const std::vector<float> input = make_network_input(scan, image, sloping);
  ASSERT_EQ(input.size(), 6 * pixels);
  EXPECT_TRUE(std::ranges::equal(std::span(input).first(5 * pixels), plain));
  const std::vector<float> slope_rad = surface_slope_rad(image, scan.points_lidar);
  for (std::size_t pixel = 0; pixel < pixels; ++pixel) {
    const bool is_empty = image.nearest()[pixel] == RangeImage::none;
    EXPECT_NEAR(input[5 * pixels + pixel], is_empty ? 0.0F : (slope_rad[pixel] - 0.5F) / 0.8F,
                1e-5F);
  }
}

TEST(NetworkInput, MasksTheFirstPointOnlyOnRequest) {
  Scan scan;
  scan.points_lidar = {{5.0F, 0.0F, 0.0F}};
  scan.intensity = {0.9F};
  const RangeImage image = project(scan, model);
  ModelDescription masking = model;
  masking.mask_first_point = true;
  const std::vector<float> zeros(5 * pixels, 0.0F);
  EXPECT_NE(make_network_input(scan, image, model), zeros);
  EXPECT_EQ(make_network_input(scan, image, masking), zeros);
}

TEST(NetworkInput, TakesTheMeanRemissionWhenThereIsNone) {
  Scan scan;
  scan.points_lidar = {{5.0F, 0.0F, 0.0F}, {-5.0F, 0.0F, 0.0F}};
  scan.intensity = {std::numeric_limits<float>::quiet_NaN(), 1.0F};
  const RangeImage image = project(scan, model);
  const auto pixel = static_cast<std::size_t>(image.pixel_of_point()[0]);
  EXPECT_EQ(make_network_input(scan, image, model)[4 * pixels + pixel], 0.0F);
  scan.intensity.clear();
  for (std::size_t i = 4 * pixels; i < 5 * pixels; ++i) {
    EXPECT_EQ(make_network_input(scan, image, model)[i], 0.0F);
  }
}

TEST(NetworkInput, IntensityOfAnotherScaleIsBroughtToTheModels) {
  const Scan scan = random_scan(3000, 2);
  const RangeImage image = project(scan, model);
  const auto scaled = [&](float factor) {
    Scan other = scan;
    for (float& intensity : other.intensity) intensity *= factor;
    return make_network_input(other, image, model);
  };
  const std::vector<float> raw_counts = scaled(255.0F), dark = scaled(0.02F);
  float difference = 0.0F, change = 0.0F;
  for (std::size_t i = 4 * pixels; i < 5 * pixels; ++i) {
    difference = std::max(difference, std::abs(raw_counts[i] - dark[i]));
    change = std::max(change, std::abs(raw_counts[i]));
  }
  EXPECT_LT(difference, 1e-3F);
  EXPECT_LT(change, 10.0F);
  // Of about the model's own scale it stays as it is.
  const float mean = model.statistics.mean[4], deviation = model.statistics.deviation[4];
  const float usual = (mean + 1.28F * deviation) / 0.9F;
  const std::vector<float> plain = scaled(usual), darker = scaled(0.9F * usual);
  for (std::size_t i = 4 * pixels; i < 5 * pixels; ++i) {
    if (plain[i] == 0.0F) continue;
    EXPECT_NEAR(darker[i] * deviation + mean, 0.9F * (plain[i] * deviation + mean), 1e-4F);
  }
}

TEST(NetworkInput, ALittleMoreIntensityChangesTheInputALittle) {
  Scan scan = random_scan(3000, 2);
  const RangeImage image = project(scan, model);
  const float mean = model.statistics.mean[4], deviation = model.statistics.deviation[4];
  const auto seen = static_cast<std::size_t>(image.pixel_of_point()[0]);
  const auto nearest = static_cast<std::size_t>(image.nearest()[seen]);
  scan.intensity[nearest] = 0.2F;
  const auto remission = [&] {
    return make_network_input(scan, image, model)[4 * pixels + seen] * deviation + mean;
  };
  for (float& intensity : scan.intensity) intensity *= 0.02F;
  float last = remission();
  for (int step = 0; step < 200; ++step) {
    for (float& intensity : scan.intensity) intensity *= 1.02F;
    const float now = remission();
    EXPECT_NEAR(now / last, 1.0F, 0.06F) << "step " << step;
    last = now;
  }
}

TEST(NetworkInput, RetroReflectorsOfAnotherScaleAreNoBrighterThanThoseOfTheUsualOne) {
  Scan scan = random_scan(3000, 2);
  for (float& intensity : scan.intensity) intensity *= 0.1F;
  const RangeImage image = project(scan, model);
  for (std::size_t i = 0; i < scan.size(); i += 50) scan.intensity[i] = 1.0F;
  const std::vector<float> input = make_network_input(scan, image, model);
  const float brightest = (1.0F - model.statistics.mean[4]) / model.statistics.deviation[4];
  int bright = 0;
  for (std::size_t i = 4 * pixels; i < 5 * pixels; ++i) {
    EXPECT_LE(input[i], brightest * 1.0001F);
    bright += input[i] > 0.999F * brightest ? 1 : 0;
  }
  EXPECT_GT(bright, 3);
}

TEST(NetworkInput, ARetroReflectorChangesLittleWithTheBrightnessOfItsScan) {
  Scan scan = random_scan(3000, 2);
  const RangeImage image = project(scan, model);
  const auto seen = static_cast<std::size_t>(image.pixel_of_point()[0]);
  const auto nearest = static_cast<std::size_t>(image.nearest()[seen]);
  const float mean = model.statistics.mean[4], deviation = model.statistics.deviation[4];
  const float usual = (mean + 1.28F * deviation) / 0.9F;
  const auto remission = [&](float factor) {
    Scan scaled = scan;
    for (float& intensity : scaled.intensity) intensity *= factor * usual;
    scaled.intensity[nearest] = 5.0F * factor;
    return make_network_input(scaled, image, model)[4 * pixels + seen] * deviation + mean;
  };
  EXPECT_NEAR(remission(1.1F), 5.5F, 1e-3F) << "of the usual scale it stays as it is";
  float last = remission(1.0F);
  for (float factor = 0.98F; factor > 0.2F; factor *= 0.98F) {
    const float now = remission(factor);
    EXPECT_NEAR(now / last, 1.0F, 0.1F) << "factor " << factor;
    last = now;
  }
  EXPECT_LE(last, 1.0001F);
}

TEST(NetworkInput, IntensityThatIsTheSameEverywhereIsNone) {
  Scan scan = random_scan(3000, 2);
  const RangeImage image = project(scan, model);
  for (const float value : {0.0F, 0.4F, std::numeric_limits<float>::quiet_NaN()}) {
    std::ranges::fill(scan.intensity, value);
    const std::vector<float> input = make_network_input(scan, image, model);
    for (std::size_t i = 4 * pixels; i < 5 * pixels; ++i) ASSERT_EQ(input[i], 0.0F);
  }
}

}  // namespace
}  // namespace stillmap
