#include "core/lidar/intensity_scale.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

namespace stillmap {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

/// Values up to `brightest`, most of them dark, as of streets.
std::vector<float> street(float brightest, bool whole) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> share(0.0F, 1.0F);
  std::vector<float> values;
  for (int i = 0; i < 20'000; ++i) {
    const float value = brightest * share(random) * share(random);
    values.push_back(whole ? std::round(value) : value);
  }
  return values;
}

TEST(IntensityFullScale, FollowsTheBrightValues) {
  EXPECT_EQ(intensity_full_scale(street(1.0F, false)), 1.0F);
  EXPECT_EQ(intensity_full_scale(street(100.0F, true)), 255.0F);
  EXPECT_EQ(intensity_full_scale(street(255.0F, true)), 255.0F);
  EXPECT_EQ(intensity_full_scale(street(4000.0F, true)), 65535.0F);
  EXPECT_EQ(intensity_full_scale({}), 1.0F);
}

TEST(IntensityFullScale, AFewBrokenValuesDoNotCount) {
  std::vector<float> values = street(1.0F, false);
  for (std::size_t i = 0; i < 20; ++i) values[i * 97] = 1e9F;
  values[5] = NAN;
  values[6] = INFINITY;
  EXPECT_EQ(intensity_full_scale(values), 1.0F);
}

TEST(IntensityScale, ADescriptionThatFitsIsKept) {
  for (const float full_scale : {1.0F, 255.0F}) {
    IntensityScale scale(1.0F / full_scale);
    std::vector<float> values = street(full_scale, full_scale > 1.0F);
    const float first = values.front();
    EXPECT_THAT(scale.apply(values), IsEmpty());
    EXPECT_FLOAT_EQ(values.front(), first / full_scale);
  }
}

TEST(IntensityScale, ADescriptionThatDoesNotFitIsCorrectedOnce) {
  IntensityScale too_large(1.0F);
  std::vector<float> values = street(255.0F, true);
  EXPECT_THAT(too_large.apply(values), HasSubstr("255"));
  EXPECT_LE(*std::ranges::max_element(values), 1.0F);
  EXPECT_THAT(too_large.apply(std::span<float>()), IsEmpty());
  values = street(255.0F, true);
  EXPECT_THAT(too_large.apply(values), IsEmpty());

  IntensityScale too_small(1.0F / 255.0F);
  values = street(0.99F, false);
  EXPECT_THAT(too_small.apply(values), HasSubstr("reaches 1 "));
  EXPECT_EQ(too_small.factor(), 1.0F);
}

TEST(IntensityScale, ADarkScanOfWholeNumbersCorrectsNothing) {
  IntensityScale scale(1.0F / 255.0F);
  std::vector<float> values(5000, 1.0F);
  EXPECT_THAT(scale.apply(values), IsEmpty());
  EXPECT_FLOAT_EQ(values.front(), 1.0F / 255.0F);
}

TEST(IntensityScale, AScaleOfItsOwnIsKeptWhereItFits) {
  // 12-bit counts, say.
  IntensityScale scale(1.0F / 4095.0F);
  std::vector<float> values = street(4095.0F, true);
  EXPECT_THAT(scale.apply(values), IsEmpty());
}

}  // namespace
}  // namespace stillmap
