#include "core/dataset/file_stamp.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

namespace stillmap {
namespace {

TEST(NsFromSeconds, IsExactForPlainDecimals) {
  EXPECT_EQ(ns_from_seconds("1539765928.346003000"), 1539765928346003000);
  EXPECT_EQ(ns_from_seconds("1539765928.346003001"), 1539765928346003001);
  EXPECT_EQ(ns_from_seconds("0.5"), 500000000);
  EXPECT_EQ(ns_from_seconds("-0.5"), -500000000);
  EXPECT_EQ(ns_from_seconds("7"), 7000000000);
  EXPECT_EQ(ns_from_seconds("7."), 7000000000);
  EXPECT_EQ(ns_from_seconds("0.1234567899"), 123456789);
}

TEST(NsFromSeconds, ReadsKittisExponents) {
  EXPECT_EQ(ns_from_seconds("1.037359e-01"), 103735900);
  EXPECT_EQ(ns_from_seconds("0.000000e+00"), 0);
}

TEST(NsFromSeconds, RefusesWhatIsNoTime) {
  for (const char* text : {"", "-", ".", "abc", "1.5s", "1 2", "nan", "inf", "1e300", "--1",
                           "99999999999999999999", "9999999999"}) {
    EXPECT_EQ(ns_from_seconds(text), std::nullopt) << text;
  }
}

TEST(StampFromName, KnowsSecondsMicrosecondsAndNanoseconds) {
  EXPECT_EQ(stamp_ns_from_name("1539765928.346003000"), 1539765928346003000);
  EXPECT_EQ(stamp_ns_from_name("1673400472138016708"), 1673400472138016708);
  EXPECT_EQ(stamp_ns_from_name("1673400472138016"), 1673400472138016000);
}

TEST(StampFromName, KnowsThoseOfOtherDataSets) {
  EXPECT_EQ(stamp_ns_from_name("1539765924815"), 1539765924815000000) << "milliseconds";
  EXPECT_EQ(stamp_ns_from_name("1583836591_182590976"), 1583836591182590976);
  EXPECT_EQ(stamp_ns_from_name("cloud_1583836591_082590976"), 1583836591082590976);
  EXPECT_EQ(stamp_ns_from_name("n015-2018-07-24-11-22-45+0800__LIDAR_TOP__1532402927647951.pcd"),
            1532402927647951000);
  EXPECT_EQ(stamp_ns_from_name("lidar_1673400472138016708"), 1673400472138016708);
}

TEST(StampFromName, IsNoneForNumbersAndWords) {
  for (const char* stem : {"scan_000012",
                           "0000000000012",
                           "scan_0000000012",
                           "12_34",
                           "_",
                           "a_",
                           "cloud_1583836591_8259",
                           "1583836591_",
                           "9583836591_182590976",
                           "9351592834600300",
                           "",
                           "0000000001_000000002",
                           "scan_0000000001_000000002",
                           "000012",
                           "scan",
                           "scan_1.5",
                           "1.5b",
                           "1.",
                           ".5",
                           "9999999999999999999",
                           "12345678901234567890"}) {
    EXPECT_EQ(stamp_ns_from_name(stem), std::nullopt) << stem;
  }
}

TEST(NaturalOrder, CountsNumbersAsNumbers) {
  std::vector<std::string> names{"10.pcd", "2.pcd", "1.pcd", "b2", "a10", "a9", "a09b", "", "a"};
  std::ranges::sort(names, natural_less);
  EXPECT_THAT(names,
              testing::ElementsAre("", "1.pcd", "2.pcd", "10.pcd", "a", "a9", "a09b", "a10", "b2"));
}

TEST(NaturalOrder, ComparesStampsOfDifferentLength) {
  EXPECT_TRUE(natural_less("1539765928.346003000.pcd", "1539765928.946003000.pcd"));
  EXPECT_TRUE(natural_less("999999999.900000000.pcd", "1000000000.000000000.pcd"));
}

TEST(NaturalOrder, IsAStrictOrder) {
  std::mt19937 random(5);
  std::vector<std::string> names;
  for (int i = 0; i < 60; ++i) {
    std::string name;
    for (unsigned k = 0; k < random() % 6; ++k) name += "01a2.b"[random() % 6];
    names.push_back(name);
  }
  for (const auto& a : names) {
    EXPECT_FALSE(natural_less(a, a)) << a;
    for (const auto& b : names) {
      EXPECT_EQ(natural_less(a, b) != natural_less(b, a), a != b) << a << " " << b;
      for (const auto& c : names) {
        if (natural_less(a, b) && natural_less(b, c)) {
          EXPECT_TRUE(natural_less(a, c)) << a << " " << b << " " << c;
        }
      }
    }
  }
}

}  // namespace
}  // namespace stillmap
