#include "tests/idl/driver_clouds.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "idl/conversions/cloud_to_scan.hpp"
#include "idl/conversions/header.hpp"

namespace stillmap::wire {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

class DriverCloud : public testing::TestWithParam<DriverLayout> {};

// Nothing is configured: names, units and scales are found.
TEST_P(DriverCloud, IsReadAsItComes) {
  const DriverLayout& layout = GetParam();
  const Scan seen = seen_by_driver();
  CloudReader reader({});
  const auto [from_cloud, news] = reader.read(as_driver_sends(layout, seen));
  ASSERT_TRUE(from_cloud.scan) << from_cloud.fault.reason;
  const Scan& scan = *from_cloud.scan;
  EXPECT_EQ(scan.stamp_ns, seen.stamp_ns);
  ASSERT_EQ(scan.size(), seen.size());
  ASSERT_EQ(scan.intensity.size(), seen.size());
  ASSERT_EQ(scan.ring.size(), layout.ring.empty() ? 0U : seen.size());
  const bool timed = layout.time != DriverTime::none;
  ASSERT_EQ(scan.time_offset_s.size(), timed ? seen.size() : 0U);
  const float begin_s = layout.time == DriverTime::seconds_before_stamp ? -0.1F : 0.0F;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (layout.organised && !was_measured(i)) {
      if (layout.invalid_is_nan) {
        ASSERT_TRUE(std::isnan(scan.points_lidar[i].x())) << i;
      }
      continue;
    }
    ASSERT_EQ(scan.points_lidar[i], seen.points_lidar[i]) << i;
    ASSERT_NEAR(scan.intensity[i], seen.intensity[i], 1e-4F) << i;
    if (!layout.ring.empty()) {
      ASSERT_EQ(scan.ring[i], seen.ring[i]) << i;
    }
    if (timed) {
      ASSERT_NEAR(scan.time_offset_s[i], begin_s + seen.time_offset_s[i], 2e-6F) << i;
    }
  }
}

TEST_P(DriverCloud, IsReadTheSameInTheOtherByteOrder) {
  const DriverLayout& layout = GetParam();
  const Scan seen = seen_by_driver();
  auto cloud = as_driver_sends(layout, seen);
  const ScanFromCloud native = to_scan(cloud, {});
  for (std::size_t i = 0; i < seen.size(); ++i) {
    const std::size_t row = i / cloud.width(), column = i % cloud.width();
    const auto point =
        cloud.data().begin() +
        static_cast<std::ptrdiff_t>(row * cloud.row_step() + column * layout.point_step);
    for (const DriverField& field : layout.fields) {
      const auto begin = point + field.offset;
      std::reverse(begin, begin + static_cast<std::ptrdiff_t>(size_of(field.type)));
    }
  }
  cloud.is_bigendian(true);
  const ScanFromCloud swapped = to_scan(cloud, {});
  ASSERT_TRUE(native.scan && swapped.scan);
  EXPECT_EQ(swapped.scan->ring, native.scan->ring);
  EXPECT_EQ(swapped.scan->intensity, native.scan->intensity);
  EXPECT_EQ(swapped.format, native.format);
}

INSTANTIATE_TEST_SUITE_P(All, DriverCloud, testing::ValuesIn(driver_layouts()),
                         [](const auto& info) { return info.param.name; });

DriverLayout layout_named(const std::string& name) {
  for (const DriverLayout& layout : driver_layouts()) {
    if (layout.name == name) return layout;
  }
  throw std::invalid_argument(name);
}

TEST(CloudReader, SaysOnceHowCloudsAreUnderstood) {
  CloudReader reader({});
  const auto cloud = as_driver_sends(layout_named("Ouster"), seen_by_driver());
  const auto first = reader.read(cloud);
  EXPECT_THAT(first.format_change, HasSubstr("intensity from reflectivity (uint16)"));
  EXPECT_THAT(first.format_change, HasSubstr("time from t (uint32: ns from the stamp)"));
  EXPECT_THAT(first.format_change, HasSubstr("ring from ring (uint16)"));
  EXPECT_THAT(first.format_change, HasSubstr("intensity reaches 255"));
  EXPECT_THAT(reader.read(cloud).format_change, IsEmpty());
}

TEST(CloudReader, SaysWhatIsMissing) {
  CloudReader reader({});
  const auto result =
      reader.read(as_driver_sends(layout_named("LivoxWithoutTimes"), seen_by_driver()));
  EXPECT_THAT(result.format_change, HasSubstr("no time"));
  EXPECT_THAT(result.format_change, HasSubstr("no ring"));
}

TEST(CloudReader, TimesOfOneConstantAreHarmless) {
  // Seen of drivers that fill the field with the time of the scan.
  const Scan seen = seen_by_driver();
  Scan at_once = seen;
  std::ranges::fill(at_once.time_offset_s, 0.0F);
  const auto cloud = as_driver_sends(layout_named("Hesai"), at_once);
  const ScanFromCloud back = to_scan(cloud, {});
  ASSERT_TRUE(back.scan);
  EXPECT_NEAR(back.scan->time_offset_s.at(7), 0.0F, 1e-6F);
}

TEST(CloudReader, AStampOfAnotherClockStillGivesTheTimesWithinTheScan) {
  // A sensor without PTP counts from its start, and the driver stamps with the host's time.
  Scan seen = seen_by_driver();
  auto cloud = as_driver_sends(layout_named("Hesai"), seen);
  cloud.header(to_header(seen.stamp_ns + 86'400'000'000'000, "sensor"));
  const ScanFromCloud back = to_scan(cloud, {});
  ASSERT_TRUE(back.scan);
  EXPECT_NEAR(back.scan->time_offset_s.at(63), seen.time_offset_s[63], 2e-6F);
  EXPECT_THAT(back.format, HasSubstr("another clock"));
}

TEST(CloudReader, AFloatRingWithNanGivesNoNonsense) {
  DriverLayout layout = layout_named("GazeboFloatRing");
  auto cloud = as_driver_sends(layout, seen_by_driver());
  const float nan = std::nanf("");
  std::memcpy(cloud.data().data() + 20, &nan, sizeof nan);
  const float huge = 1e30F;
  std::memcpy(cloud.data().data() + 24 + 20, &huge, sizeof huge);
  const ScanFromCloud back = to_scan(cloud, {});
  ASSERT_TRUE(back.scan);
  EXPECT_EQ(back.scan->ring[0], 0);
  EXPECT_EQ(back.scan->ring[1], 65535);
}

}  // namespace
}  // namespace stillmap::wire
