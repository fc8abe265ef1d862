#include "clients/commands/mapping/run_file.hpp"

#include <gtest/gtest.h>

namespace stillmap::cli {
namespace {

using Indices = std::vector<std::size_t>;

TEST(RunFileRanges, ComeBackAsTheyWere) {
  for (const Indices& indices : {Indices{}, Indices{0}, Indices{7, 8}, Indices{0, 1, 2, 59, 61}}) {
    EXPECT_EQ(from_ranges(to_ranges(indices)), indices) << to_ranges(indices);
  }
  EXPECT_EQ(to_ranges({0, 1, 2, 59, 61}), "0-2,59,61");
}

TEST(RunFileRanges, OtherTextIsRefused) {
  for (const char* const text : {"x", "1-", "3-1", "1:2", "-1", "0-99999999999", "5,4", "1-3,3",
                                 "0-9999999,0-9999999,0-9999999"}) {
    EXPECT_FALSE(from_ranges(text)) << text;
  }
}

TEST(RunFileSettings, OnlyWhatDiffersIsNamed) {
  const auto [one, other] =
      different_parts("sensor VLP-16, labels none, loops closed", "sensor VLP-16, labels street");
  EXPECT_EQ(one, "labels none, loops closed");
  EXPECT_EQ(other, "labels street");
  EXPECT_EQ(different_parts("a, b", "a").second, "");
}

}  // namespace
}  // namespace stillmap::cli
