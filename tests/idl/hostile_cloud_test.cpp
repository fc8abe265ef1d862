#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <random>

#include "idl/conversions/cloud_to_scan.hpp"
#include "tests/idl/cloud_fixture.hpp"

namespace stillmap::wire {
namespace {

using sensor_msgs::msg::PointCloud2;

struct HostileCase {
  const char* name;
  const char* counter;
  /// What the reason must name.
  const char* named;
  std::function<void(PointCloud2&)> spoil;
};

class HostileCloud : public testing::TestWithParam<HostileCase> {};

TEST_P(HostileCloud, IsRefusedWithAReason) {
  auto cloud = three_points();
  GetParam().spoil(cloud);
  const ScanFromCloud result = to_scan(cloud, {});
  ASSERT_FALSE(result.scan);
  EXPECT_EQ(result.fault.counter, GetParam().counter);
  EXPECT_NE(result.fault.reason.find(GetParam().named), std::string::npos) << result.fault.reason;
}

constexpr auto most = std::numeric_limits<std::uint32_t>::max();

INSTANTIATE_TEST_SUITE_P(
    All, HostileCloud,
    testing::Values(
        HostileCase{"Nothing", "no_points", "width 0", [](auto& c) { c = PointCloud2(); }},
        HostileCase{"NoWidth", "no_points", "width 0", [](auto& c) { c.width(0); }},
        HostileCase{"NoHeight", "no_points", "height 0", [](auto& c) { c.height(0); }},
        HostileCase{"NoData", "size_mismatch", "0 bytes", [](auto& c) { c.data().clear(); }},
        HostileCase{"ByteMissing", "size_mismatch", "35 bytes",
                    [](auto& c) { c.data().pop_back(); }},
        HostileCase{"TooWide", "size_mismatch", "width 4", [](auto& c) { c.width(4); }},
        HostileCase{"HugeWidth", "size_mismatch", "4294967295", [](auto& c) { c.width(most); }},
        HostileCase{"HugeEverything", "size_mismatch", "4294967295",
                    [](auto& c) {
                      c.width(most);
                      c.height(most);
                      c.point_step(most);
                      c.row_step(most);
                    }},
        HostileCase{"TooHigh", "size_mismatch", "height 2", [](auto& c) { c.height(2); }},
        HostileCase{"RowsOverlap", "size_mismatch", "row_step 4",
                    [](auto& c) {
                      c.height(2);
                      c.row_step(4);
                    }},
        HostileCase{"NoPointStep", "size_mismatch", "point_step", [](auto& c) { c.point_step(0); }},
        HostileCase{"NoFields", "no_xyz", "field x", [](auto& c) { c.fields().clear(); }},
        HostileCase{"NoZ", "no_xyz", "field z", [](auto& c) { c.fields().pop_back(); }},
        HostileCase{"NameWithWrongCase", "no_xyz", "field x",
                    [](auto& c) { c.fields()[0].name("X"); }},
        HostileCase{"UnknownType", "bad_field", "datatype 9",
                    [](auto& c) { c.fields()[1].datatype(9); }},
        HostileCase{"TypeZero", "bad_field", "datatype 0",
                    [](auto& c) { c.fields()[1].datatype(0); }},
        HostileCase{"FieldBeyondPoint", "bad_field", "beyond point_step",
                    [](auto& c) { c.fields()[2].offset(9); }},
        HostileCase{"OffsetOverflow", "bad_field", "beyond point_step",
                    [](auto& c) { c.fields()[2].offset(most); }},
        HostileCase{"DoubleInAFloatsPlace", "bad_field", "beyond point_step",
                    [](auto& c) { c.fields()[2].datatype(8); }},
        HostileCase{"ManyValuesAField", "bad_field", "count 3",
                    [](auto& c) { c.fields()[0].count(3); }},
        HostileCase{"NoValueAField", "bad_field", "count 0",
                    [](auto& c) { c.fields()[0].count(0); }},
        HostileCase{"StampBeyondASecond", "bad_stamp", "nanosec",
                    [](auto& c) { c.header().stamp().nanosec(1'000'000'000); }}),
    [](const auto& info) { return std::string(info.param.name); });

TEST(HostileCloudFuzz, NeverReadsOutsideTheData) {
  // Sanitizers watch; here only that every answer is one of the two.
  std::mt19937 random(11);
  const auto small = [&] { return static_cast<std::uint32_t>(random() % 40); };
  for (int i = 0; i < 20'000; ++i) {
    auto cloud = three_points_with<std::uint32_t>("label", FieldType::uint32, {1, 2, 3});
    cloud.width(small());
    cloud.height(small() % 4);
    cloud.point_step(small());
    cloud.row_step(small() * small());
    cloud.is_bigendian(random() % 2 == 0);
    for (auto& field : cloud.fields()) {
      field.offset(small());
      field.datatype(static_cast<std::uint8_t>(random() % 10));
    }
    cloud.data().resize(random() % 500);
    const ScanFromCloud result = to_scan(cloud, {});
    ASSERT_NE(result.scan.has_value(), !result.fault.reason.empty());
    if (!result.scan) continue;
    ASSERT_EQ(result.scan->size(), cloud.width() * cloud.height());
  }
}

}  // namespace
}  // namespace stillmap::wire
