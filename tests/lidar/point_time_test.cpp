#include "core/lidar/point_time.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace stillmap {
namespace {

using testing::ElementsAre;
using testing::FloatNear;
using Times = std::vector<double>;

TEST(TimeOffsets, KeepsOffsetsOfEitherSign) {
  EXPECT_THAT(time_offsets_from_seconds(Times{-0.1, 0.0, 0.05}, 1'600'000'000'000'000'000),
              ElementsAre(-0.1F, 0.0F, 0.05F));
}

TEST(TimeOffsets, TakesAbsoluteTimesRelativeToTheStamp) {
  EXPECT_THAT(time_offsets_from_seconds(Times{1.6e9, 1.6e9 + 0.05}, 1'600'000'000'025'000'000),
              ElementsAre(FloatNear(-0.025F, 1e-6F), FloatNear(0.025F, 1e-6F)));
}

TEST(TimeOffsets, TakesTimesOfAnotherClockRelativeToTheEarliest) {
  EXPECT_THAT(time_offsets_from_seconds(Times{5000.1, 5000.0}, 1'600'000'000'000'000'000),
              ElementsAre(FloatNear(0.1F, 1e-6F), 0.0F));
}

TEST(TimeOffsets, PassesBrokenTimesOn) {
  const auto offsets = time_offsets_from_seconds(Times{NAN, 0.1, INFINITY}, 0);
  EXPECT_TRUE(std::isnan(offsets[0]));
  EXPECT_FLOAT_EQ(offsets[1], 0.1F);
  EXPECT_FALSE(std::isfinite(offsets[2]));
  EXPECT_TRUE(time_offsets_from_seconds({}, 0).empty());
  EXPECT_TRUE(std::isnan(time_offsets_from_seconds(Times{NAN}, 0)[0]));
}

}  // namespace
}  // namespace stillmap
