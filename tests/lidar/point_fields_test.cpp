#include "core/lidar/point_fields.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <random>
#include <vector>

namespace stillmap {
namespace {

using testing::ElementsAre;
using testing::FloatNear;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Pointwise;
using Times = std::vector<double>;

constexpr std::int64_t stamp_ns = 1'600'000'000'000'000'000;
constexpr double stamp_s = 1.6e9;

std::vector<float> offsets(const Times& times, TimeType type = TimeType::float64,
                           std::int64_t stamp = stamp_ns) {
  return point_times(times, type, stamp).offsets_s;
}

TEST(PointTimes, KeepsOffsetsOfEitherSign) {
  EXPECT_THAT(offsets({-0.1, 0.0, 0.05}), ElementsAre(-0.1F, 0.0F, 0.05F));
}

TEST(PointTimes, TakesAbsoluteTimesRelativeToTheStamp) {
  EXPECT_THAT(offsets({1.6e9, 1.6e9 + 0.05}, TimeType::float64, 1'600'000'000'025'000'000),
              ElementsAre(FloatNear(-0.025F, 1e-6F), FloatNear(0.025F, 1e-6F)));
}

TEST(PointTimes, TakesTimesOfAnotherClockRelativeToTheEarliest) {
  const PointTimes times = point_times(Times{5000.1, 5000.0}, TimeType::float64, stamp_ns);
  EXPECT_THAT(times.offsets_s, ElementsAre(FloatNear(0.1F, 1e-6F), 0.0F));
  EXPECT_THAT(times.remark, HasSubstr("another clock"));
}

TEST(PointTimes, TakesASimulatorsClockForWhatItIs) {
  for (const double now_s : {0.0, 0.3, 5.2, 900.0}) {
    const auto stamp = static_cast<std::int64_t>(now_s * 1e9);
    EXPECT_THAT(
        offsets({now_s, now_s + 0.05, now_s + 0.1}, TimeType::float64, stamp),
        ElementsAre(FloatNear(0.0F, 1e-6F), FloatNear(0.05F, 1e-6F), FloatNear(0.1F, 1e-6F)))
        << now_s;
  }
}

TEST(PointTimes, AStampSecondsFromItsPointsIsOfAnotherClock) {
  EXPECT_THAT(offsets({1.6e9 - 3.0, 1.6e9 - 2.9}), ElementsAre(0.0F, FloatNear(0.1F, 1e-6F)));
}

TEST(PointTimes, PassesBrokenTimesOn) {
  const auto broken = offsets({NAN, 0.1, 0.1, INFINITY}, TimeType::float32, 0);
  EXPECT_TRUE(std::isnan(broken[0]));
  EXPECT_FLOAT_EQ(broken[1], 0.1F);
  EXPECT_FALSE(std::isfinite(broken[3]));
  EXPECT_THAT(offsets({}), IsEmpty());
  EXPECT_THAT(offsets({NAN}), IsEmpty());
}

struct UnitCase {
  const char* name;
  TimeType type;
  double per_second;
  /// Of the first point [s].
  double begin_s;
};

class TimeUnits : public testing::TestWithParam<UnitCase> {};

TEST_P(TimeUnits, AreFoundFromMagnitudeAndSpan) {
  const auto& [name, type, per_second, begin_s] = GetParam();
  Times times;
  std::vector<float> expected;
  for (int i = 0; i <= 100; ++i) {
    const double offset_s = 0.001 * i;
    times.push_back((begin_s + offset_s) * per_second);
    if (type == TimeType::integer) times.back() = std::round(times.back());
    if (type == TimeType::float32) times.back() = static_cast<float>(times.back());
    const double reference_s = begin_s < 100.0 || begin_s > 1e9 ? begin_s : 0.0;
    expected.push_back(
        static_cast<float>(offset_s + (begin_s > 1e9 ? begin_s - stamp_s : reference_s)));
  }
  EXPECT_THAT(offsets(times, type), Pointwise(FloatNear(1e-5F), expected));
}

INSTANTIATE_TEST_SUITE_P(
    All, TimeUnits,
    testing::Values(UnitCase{"VelodyneOffsets", TimeType::float32, 1.0, 0.0},
                    UnitCase{"VelodyneOffsetsFromTheEnd", TimeType::float32, 1.0, -0.1},
                    UnitCase{"OusterNanoseconds", TimeType::integer, 1e9, 0.0},
                    UnitCase{"WholeMicroseconds", TimeType::integer, 1e6, 0.0},
                    UnitCase{"WholeMicrosecondsOfTheHour", TimeType::integer, 1e6, 3000.0},
                    UnitCase{"FloatMilliseconds", TimeType::float32, 1e3, 0.0},
                    UnitCase{"FloatNanoseconds", TimeType::float32, 1e9, 0.0},
                    UnitCase{"DoubleNanoseconds", TimeType::float64, 1e9, 0.0},
                    UnitCase{"HesaiSince1970", TimeType::float64, 1.0, stamp_s},
                    UnitCase{"RoboSenseStampAtTheEnd", TimeType::float64, 1.0, stamp_s - 0.1},
                    UnitCase{"MicrosecondsSince1970", TimeType::float64, 1e6, stamp_s},
                    UnitCase{"LivoxNanosecondsSince1970", TimeType::float64, 1e9, stamp_s},
                    UnitCase{"NanosecondsSinceTheStart", TimeType::float64, 1e9, 1000.0}),
    [](const auto& info) { return std::string(info.param.name); });

TEST(PointTimes, AFewZerosAmongAbsoluteTimesAreNoTimes) {
  // RoboSense and Ouster write 0 for points that were not measured.
  Times times(100, stamp_s + 0.02);
  times[0] = times[50] = 0.0;
  const auto read = offsets(times);
  EXPECT_TRUE(std::isnan(read[0]));
  EXPECT_TRUE(std::isnan(read[50]));
  EXPECT_NEAR(read[1], 0.02, 1e-6);
}

TEST(PointTimes, AbsoluteTimesInSmallFloatsAreNone) {
  const PointTimes times = point_times(Times(10, 1.6e9), TimeType::float32, stamp_ns);
  EXPECT_THAT(times.offsets_s, IsEmpty());
  EXPECT_THAT(times.remark, HasSubstr("32-bit"));
}

TEST(PointTimes, NumbersInNoUnitAreNoTimes) {
  Times times;
  for (int i = 0; i < 100; ++i) times.push_back(1e12 * i);
  const PointTimes read = point_times(times, TimeType::float64, stamp_ns);
  EXPECT_THAT(read.offsets_s, IsEmpty());
  EXPECT_THAT(read.remark, HasSubstr("no unit"));
}

TEST(PointTimes, AnyNumbersGiveNoneOrOneEach) {
  std::mt19937_64 random(5);
  for (int round = 0; round < 2000; ++round) {
    Times times(random() % 40);
    for (double& t : times) {
      const std::uint64_t bits = random();
      t = round % 2 == 0 ? std::bit_cast<double>(bits) : static_cast<double>(bits >> (bits % 64));
    }
    const auto type = static_cast<TimeType>(round % 3);
    const auto read = offsets(times, type, static_cast<std::int64_t>(random()));
    ASSERT_TRUE(read.empty() || read.size() == times.size());
  }
}

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
  EXPECT_EQ(values, street(0.99F, false));
}

TEST(IntensityScale, OneBrokenScanChangesNothingForTheOthers) {
  for (const int fitting_before : {0, 3}) {
    IntensityScale scale(1.0F);
    std::vector<float> values;
    for (int i = 0; i < fitting_before; ++i) {
      values = street(0.99F, false);
      EXPECT_THAT(scale.apply(values), IsEmpty());
    }
    for (int broken = 0; broken < 20; ++broken) {
      values = street(60'000.0F, true);
      EXPECT_THAT(scale.apply(values), HasSubstr("65535"));
      EXPECT_LE(*std::ranges::max_element(values), 1.0F);
      values = street(0.99F, false);
      EXPECT_THAT(scale.apply(values), IsEmpty());
      EXPECT_EQ(values, street(0.99F, false));
    }
  }
}

TEST(IntensityScale, ADescriptionThatWasDisprovedIsNotUsedForDarkScans) {
  IntensityScale scale(1.0F);
  std::vector<float> values;
  for (int i = 0; i < 5; ++i) {
    values = street(255.0F, true);
    EXPECT_EQ(scale.apply(values).empty(), i > 0);
  }
  values.assign(5000, 1.0F);
  EXPECT_THAT(scale.apply(values), IsEmpty());
  EXPECT_FLOAT_EQ(values.front(), 1.0F / 255.0F);
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

TEST(AxesBy, NamesTurnsAndMirrorsPoints) {
  EXPECT_TRUE(axes_by({}).isIdentity(0.0F));
  EXPECT_TRUE(axes_in_words({}).empty());
  PointFieldNames unity;
  unity.x = {"Z", "z"};
  unity.y = {"-x"};
  unity.z = {"y"};
  // A metre to the right, two up, three ahead.
  EXPECT_EQ(axes_by(unity) * Eigen::Vector3f(1.0F, 2.0F, 3.0F), Eigen::Vector3f(3.0F, -1.0F, 2.0F));
  EXPECT_EQ(axes_in_words(unity), "x from Z, y from -x, z from y, ");
  EXPECT_EQ(coordinate_field("-y").name, "y");
  EXPECT_EQ(coordinate_field("-y").sign, -1.0F);
  // Names of files that have none say nothing of those that go by their order.
  PointFieldNames other;
  other.x = {"-forward", "", "-"};
  EXPECT_TRUE(axes_by(other).isIdentity(0.0F));
  EXPECT_TRUE(are_axes(axes_by(unity)));
  unity.y = {"left"};
  EXPECT_FALSE(are_axes(axes_by(unity)));
}

TEST(PointTimes, OfACounterThatBeginsAnewWithinTheScanGoOn) {
  constexpr double full_turn = 4294967296.0;
  constexpr int points = 1000;
  // From the scan's first point on: ns of a counter that runs for 4.3 s.
  for (const double before_s : {0.01, 0.05, 0.099}) {
    Times times;
    for (int i = 0; i < points; ++i)
      times.push_back(std::fmod(full_turn + 1e8 * i / points - 1e9 * before_s, full_turn));
    const std::vector<float> found = offsets(times, TimeType::integer);
    ASSERT_EQ(found.size(), times.size()) << before_s;
    EXPECT_NEAR(found.front(), 0.0F, 1e-6F) << before_s;
    EXPECT_NEAR(found[points / 2], 0.05F, 1e-6F) << before_s;
    EXPECT_NEAR(found.back(), 0.0999F, 1e-6F) << before_s;
  }
  // A broken time is no such counter.
  Times times(points, 2e7);
  times[7] = full_turn - 1e7;
  EXPECT_FLOAT_EQ(offsets(times, TimeType::integer).front(), 0.02F);
}

}  // namespace
}  // namespace stillmap
